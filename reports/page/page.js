// What the page can do beyond being read: series on and off, values, zoom, pickers, sorting, light and dark.
"use strict";

const SVG_REACH = 14; // points on a figure within which a value is shown
const make = (name, attributes = {}, ...children) => {
  const element = document.createElement(name);
  for (const [key, value] of Object.entries(attributes)) element.setAttribute(key, value);
  element.append(...children);
  return element;
};

function themed() {
  const root = document.documentElement;
  const asked = matchMedia("(prefers-color-scheme: dark)");
  const dark = () => root.dataset.theme ? root.dataset.theme === "dark" : asked.matches;
  const button = make("button", { type: "button", class: "theme" });
  const name = () => { button.textContent = dark() ? "Light" : "Dark"; };
  button.addEventListener("click", () => { root.dataset.theme = dark() ? "light" : "dark"; name(); });
  asked.addEventListener("change", name);
  name();
  document.querySelector("header").append(button);
}

function toggles(view, lines, tools) {
  const series = new Map();
  for (const [label, colour, place] of lines) {
    if (!series.has(label)) series.set(label, { colour: "", parts: [] });
    const one = series.get(label);
    one.colour ||= colour;
    one.parts.push(document.getElementById(`${view.dataset.prefix}series-${place}`));
  }
  for (const [label, { colour, parts }] of series.size > 1 ? series : []) {
    const swatch = make("span", { class: "swatch" });
    swatch.style.background = colour || "var(--grid)";
    const button = make("button", { type: "button", "aria-pressed": "true" }, swatch, label);
    button.addEventListener("click", () => {
      const on = button.getAttribute("aria-pressed") !== "true";
      button.setAttribute("aria-pressed", String(on));
      for (const part of parts) part?.classList.toggle("off", !on);
    });
    tools.append(button);
  }
}

function values(view, svg, { panels, lines }) {
  const box = make("div", { class: "value", role: "status", hidden: "" });
  view.append(box);
  const seen = place => !document.getElementById(`${view.dataset.prefix}series-${place}`)?.classList.contains("off");
  const nearest = at => {
    let best = null, least = SVG_REACH;
    for (const [label, , place, panel, points] of lines) {
      if (!seen(place)) continue;
      for (const point of points) {
        const off = Math.hypot(point[0] - at.x, point[1] - at.y);
        if (off < least) [best, least] = [{ label, panel: panels[panel], point }, off];
      }
    }
    return best;
  };
  const show = event => {
    const at = new DOMPoint(event.clientX, event.clientY).matrixTransform(svg.getScreenCTM().inverse());
    const found = nearest(at);
    box.hidden = !found;
    if (!found) return;
    const [title, across, up] = found.panel, [, , x, y, note] = found.point;
    const said = [found.label, title, up && `${up}: ${y}`, across && `${across}: ${x}`, note].filter(Boolean);
    box.replaceChildren(...said.map(text => make("div", {}, text)));
    const frame = view.getBoundingClientRect();
    const left = Math.min(event.clientX - frame.left + 12, frame.width - box.offsetWidth);
    box.style.left = `${Math.max(0, left)}px`;
    box.style.top = `${event.clientY - frame.top + 14}px`;
  };
  svg.addEventListener("pointermove", show);
  svg.addEventListener("pointerdown", show);
  // A finger that is lifted leaves, too: what it has tapped stays.
  svg.addEventListener("pointerleave", event => { box.hidden ||= event.pointerType === "mouse"; });
}

function zoom(svg, tools) {
  const whole = svg.viewBox.baseVal, [x, y, width, height] = [whole.x, whole.y, whole.width, whole.height];
  let view = { x, y, width, height };
  const put = next => {
    view = next;
    svg.setAttribute("viewBox", `${view.x} ${view.y} ${view.width} ${view.height}`);
    svg.classList.toggle("zoomed", view.width < width);
  };
  const scale = (factor, at) => {
    const size = Math.min(width, Math.max(width / 12, view.width * factor)), part = size / view.width;
    if (size >= width) return put({ x, y, width, height });
    put({ x: at.x - (at.x - view.x) * part, y: at.y - (at.y - view.y) * part, width: size, height: view.height * part });
  };
  const middle = () => ({ x: view.x + view.width / 2, y: view.y + view.height / 2 });
  const here = event => new DOMPoint(event.clientX, event.clientY).matrixTransform(svg.getScreenCTM().inverse());
  for (const [sign, words, work] of [["+", "Zoom in", () => scale(0.6, middle())],
    ["−", "Zoom out", () => scale(1 / 0.6, middle())]]) {
    const button = make("button", { type: "button", "aria-label": words }, sign);
    button.addEventListener("click", work);
    tools.append(button);
  }
  svg.addEventListener("wheel", event => {
    if (!event.ctrlKey) return;
    event.preventDefault();
    scale(event.deltaY > 0 ? 1.2 : 1 / 1.2, here(event));
  }, { passive: false });
  let held = null;
  svg.addEventListener("pointerdown", event => {
    if (view.width >= width) return;
    held = here(event);
    svg.setPointerCapture(event.pointerId);
  });
  svg.addEventListener("pointermove", event => {
    if (!held) return;
    const now = here(event);
    put({ ...view, x: view.x + held.x - now.x, y: view.y + held.y - now.y });
  });
  for (const end of ["pointerup", "pointercancel"]) svg.addEventListener(end, () => { held = null; });
}

function measured(text) {
  const found = text.replace("−", "-").match(/-?\d+(\.\d+)?(e[+-]\d+)?/i);
  return found ? Number(found[0]) : null;
}

function sortable(table) {
  const body = table.tBodies[0], heads = [...table.tHead.rows[0].cells];
  heads.forEach((head, column) => {
    const button = make("button", { type: "button" }, ...head.childNodes);
    head.replaceChildren(button);
    button.addEventListener("click", () => {
      const down = head.getAttribute("aria-sort") === "ascending";
      for (const other of heads) other.removeAttribute("aria-sort");
      head.setAttribute("aria-sort", down ? "descending" : "ascending");
      const rows = [...body.rows].map(row => ({ row, text: row.cells[column].textContent }));
      const numeric = rows.every(({ text }) => text === "–" || /^[<\[]?\s?-?\d/.test(text));
      const order = numeric
        ? (one, other) => (measured(one.text) ?? Infinity) - (measured(other.text) ?? Infinity)
        : (one, other) => one.text.localeCompare(other.text, undefined, { numeric: true });
      rows.sort((one, other) => (down ? -1 : 1) * order(one, other));
      body.append(...rows.map(({ row }) => row));
    });
  });
}

// A picker for each dimension of a figure's views; what is not there with the others moves them along.
function pickers(figure) {
  const place = figure.querySelector(".pickers");
  if (!place) return;
  const names = JSON.parse(place.dataset.pickers);
  const views = [...figure.querySelectorAll(".view")].map(view => ({ view, choice: JSON.parse(view.dataset.choice) }));
  const fields = names.map((name, k) => {
    const options = [...new Set(views.map(({ choice }) => choice[k]))].map(value => make("option", { value }, value));
    const field = make("select", {}, ...options);
    place.append(make("label", {}, `${name} `, field));
    return field;
  });
  const show = changed => {
    const score = ({ choice }) => choice.reduce((sum, value, k) =>
      sum + (value === fields[k].value) * (k === changed ? names.length : 1), 0);
    const best = views.reduce((one, other) => score(other) > score(one) ? other : one);
    for (const { view } of views) view.hidden = view !== best.view;
    best.choice.forEach((value, k) => { fields[k].value = value; });
  };
  fields.forEach((field, k) => field.addEventListener("change", () => show(k)));
}

function unfolded() {
  const opened = [];
  addEventListener("beforeprint", () => {
    for (const part of document.querySelectorAll("details:not([open])")) { part.open = true; opened.push(part); }
  });
  addEventListener("afterprint", () => { for (const part of opened.splice(0)) part.open = false; });
  const reveal = () => {
    const target = location.hash && document.getElementById(decodeURIComponent(location.hash.slice(1)));
    for (let part = target; part; part = part.parentElement) if (part.tagName === "DETAILS") part.open = true;
    if (target) target.scrollIntoView();
  };
  addEventListener("hashchange", reveal);
  reveal();
}

themed();
for (const figure of document.querySelectorAll("figure.drawing")) {
  for (const view of figure.querySelectorAll(".view")) {
    const svg = view.querySelector("svg"), data = JSON.parse(view.querySelector("script").textContent);
    const tools = make("div", { class: "tools" });
    zoom(svg, tools);
    toggles(view, data.lines, tools);
    values(view, svg, data);
    view.prepend(tools);
  }
  pickers(figure);
}
for (const table of document.querySelectorAll("figure.table table")) sortable(table);
unfolded();
