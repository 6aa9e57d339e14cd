"""Tables, figures and the page, made from saved result files alone."""
