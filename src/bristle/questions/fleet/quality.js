// Tables that stand in the page as texts, and the kinds of warnings over time.
"use strict";
fleet.quality = (() => {
  const { charts, element, known, make } = fleet;
  const SIGNS = { circle: "●", square: "■", triangle: "▲", diamond: "◆", inverted_triangle: "▼", x: "✕" };

  // A table of texts; codes are links to their entries.
  function texts(name, kinds, codes = -1) {
    const rows = known.tables[name];
    if (!element(`table-${name}`)) return;
    const cells = kinds.map((kind, at) => ({ show: (k) => (at === codes ? fleet.codes(rows[k][at]) : rows[k][at]), by: (k) => rows[k][at], kind }));
    fleet.paged({ name, count: rows.length, cells, words: (k) => rows[k].join(" ").toLowerCase() });
  }

  function chart() {
    const { periods, codes } = known.quality;
    if (!codes.length || !element("quality-panel")) return;
    element("quality-panel").hidden = false;
    known.looks.forEach((_, k) => charts.fill(`quality${k}`, { x: [], y: [] }));
    for (const { look, percent } of codes) charts.fill(`quality${look}`, { x: periods, y: percent });
    element("quality-key").replaceChildren(...codes.map(({ code, look }) => {
      const { colour, dash, marker } = known.looks[look], line = dash === "solid" ? "solid" : dash === "dotted" ? "dotted" : "dashed";
      const sign = make("span", { className: "mark" }, SIGNS[marker]), sample = make("span", { className: line });
      for (const part of [sign, sample]) part.style.color = colour;
      return make("span", { className: "sample" }, sample, sign, fleet.codes(code));
    }));
    const most = Math.max(...codes.flatMap(({ percent }) => percent), 0.1), alone = periods.length > 1 ? 0 : 15 * 86400000;
    charts.frame("quality", "y_range", 0, most, 0.05);
    charts.frame("quality", "x_range", periods[0] - alone, periods.at(-1) + alone, 0.03);
    charts.titles("quality", "Session (UTC)", "Joint-sessions with the warning (%)");
  }

  function start() {
    texts("types", ["name", "s", "n", "n", "s", "n", "n", "n", "n", "n", "n"]);
    texts("quality", ["s", "s", "n", "n", "n", "text long"], 0);
    texts("warned", ["name", "name", "s", "s", "s", "n", "n"], 2);
    texts("failures", ["name", "name", "s", "text long", "name file"]);
    chart();
  }

  return { start };
})();
