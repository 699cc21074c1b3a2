// Bokeh's figures, found by their names: what they are filled with, their ranges, their labels and colours.
"use strict";
fleet.charts = (() => {
  const { element, known } = fleet;
  let bokeh = null;
  const named = (name) => bokeh.get_model_by_name(name);

  function fill(name, columns) {
    named(name).data = columns;
  }

  // Ranges of a figure that show all of these numbers with a margin.
  function frame(name, axis, low, high, margin = 0.06) {
    const wide = high > low ? high - low : Math.max(Math.abs(low), 1e-9) * 0.1;
    const start = low - margin * wide, end = high + margin * wide;
    named(name)[axis].setv({ start, end, reset_start: start, reset_end: end });
  }

  function titles(name, x, y) {
    for (const [place, words] of [["below", x], ["left", y]]) {
      for (const axis of named(name)[place]) if ("axis_label" in axis) axis.axis_label = words;
    }
  }

  function label(name, words) {
    element(`figure-${name}`).setAttribute("aria-label", words);
  }

  function colours() {
    const style = getComputedStyle(document.documentElement);
    const ink = style.getPropertyValue("--ink").trim(), line = style.getPropertyValue("--line").trim();
    for (const name of Object.keys(known.roots)) {
      const plot = named(name);
      for (const place of ["below", "left", "center"]) {
        for (const part of plot[place]) {
          if ("axis_label" in part) {
            part.setv({
              axis_label_text_color: ink, major_label_text_color: ink, axis_line_color: ink,
              major_tick_line_color: ink, minor_tick_line_color: line,
            });
          } else if ("grid_line_color" in part) part.setv({ grid_line_color: line });
        }
      }
    }
  }

  // On a phone fewer dates fit below a chart.
  function narrow() {
    for (const name of ["time", "quality"]) {
      for (const axis of named(name).below) if ("ticker" in axis) axis.ticker.setv({ desired_num_ticks: innerWidth < 640 ? 3 : 6 });
    }
  }

  async function start() {
    const { document: model, roots } = known;
    Bokeh.set_log_level("error"); // of figures that are still empty it would warn
    const drawn = Object.keys(roots).filter((name) => element(`figure-${name}`));
    const places = Object.fromEntries(drawn.map((name) => [roots[name], `figure-${name}`]));
    await Bokeh.embed.embed_items({ fleet: model }, [{ docid: "fleet", roots: places, root_ids: drawn.map((name) => roots[name]) }]);
    bokeh = Bokeh.documents[0];
    colours();
    narrow();
    addEventListener("resize", narrow);
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", colours);
  }

  return { fill, frame, label, named, start, titles };
})();
