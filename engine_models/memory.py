"""What a run will need of memory, known before it starts, and refused where there is not as much."""

from pathlib import Path

from engine_models.engine import RunSettings, UnsupportedScene
from engine_models.scene.scene import Scene

#: Measured with two contacts: of a sample all engines keep up to 2.1 kB, its row in a table included.
BYTES_PER_SAMPLE, BYTES_PER_CONTACT = 1_000, 750
#: What there is to a run where the machine does not tell what is free.
UNTOLD_BYTES = 4 * 10**9


def require_memory(
    scene: Scene, settings: RunSettings, recorded_steps: int = 0, bytes_per_step: int = 0
) -> None:
    """Check that the states of samples, and what an engine keeps of ``recorded_steps``, fit into the memory.

    Raises:
        UnsupportedScene: they do not.
    """
    per_sample = BYTES_PER_SAMPLE + BYTES_PER_CONTACT * len(scene.clearances)
    samples, steps = (settings.samples + 1) * per_sample, recorded_steps * bytes_per_step
    free, need = free_bytes(), samples + steps
    if need > free:
        used = settings.step_used_s(scene.end_time_s) * steps / max(free - samples, 1)
        longer = f"step: expected at least {used:.3g}, got {settings.step_s:g}"
        fewer = f"samples: expected at most {settings.samples * free / need:.3g}, got {settings.samples}"
        told = f"(needs {need / 1e9:.3g} GB of memory, {free / 1e9:.3g} GB are free)"
        raise UnsupportedScene(f"{longer if steps > samples else fewer} {told}")


def free_bytes() -> int:
    """Return how much memory the machine has free, but no more than this process's group may have."""
    try:
        lines = Path("/proc/meminfo").read_text(encoding="ascii").splitlines()
        free = next(int(line.split()[1]) * 1024 for line in lines if line.startswith("MemAvailable:"))
        limit = Path("/sys/fs/cgroup/memory.max")  # not less what the group uses: cached files make room
        most = limit.read_text(encoding="ascii").strip() if limit.exists() else "max"
        return free if most == "max" else min(free, int(most))
    except (OSError, StopIteration):  # another system
        return UNTOLD_BYTES
