// The units' values; of a chosen type and parameter all of them in a chart, by value.
"use strict";
fleet.units = (() => {
  const { charts, element, known, make } = fleet;
  const table = fleet.columns(known.units), count = table.unit.count;
  const state = { spread: null, row: -1, rows: [] };

  const label = (k) => fleet.quantity(table.quantity(k)).label;
  const own = (k) => fleet.measured(table.value(k), table.standard_error(k));
  const drawn = (k) => fleet.measured(table.shrunken(k), table.shrunken_error(k));
  const finding = (k) => (table.outside(k) ? "outside" : "not outside");
  const unitOf = (k) => fleet.quantity(table.quantity(k)).unit;
  const CELLS = [
    { show: (k) => make("button", { type: "button", className: "choose" }, table.unit(k)), by: table.unit, kind: "name" },
    { show: table.joint, by: table.joint, kind: "name" },
    { show: label, by: label, kind: "s" },
    { show: (k) => make("span", { className: table.outside(k) ? "finding" : "" }, finding(k)), by: finding, kind: "s" },
    { show: own, by: table.value, kind: "n" },
    { show: drawn, by: table.shrunken, kind: "n" },
    { show: unitOf, by: unitOf, kind: "s" },
    { show: (k) => fleet.number(table.borrowed_percent(k), 3), by: table.borrowed_percent, kind: "n" },
    { show: (k) => fleet.signed(table.percent(k)), by: table.percent, kind: "n" },
    { show: (k) => fleet.probability(table.adjusted_p(k)), by: table.adjusted_p, kind: "n" },
    { show: (k) => String(table.sessions(k)), by: table.sessions, kind: "n" },
    { show: table.type, by: table.type, kind: "name" },
  ];
  const words = (k) => [table.unit(k), table.joint(k), table.type(k), label(k), finding(k)].join(" ").toLowerCase();
  const charted = (k) => state.spread !== null && table.type(k) === state.spread.type && table.quantity(k) === state.spread.quantity;
  const WAYS = { "all values": () => true, "outside their type": (k) => table.outside(k) === 1, "those of the chart": charted };
  let list = null;

  function spread(type, quantity) {
    return known.spreads.find((one) => one.type === type && one.quantity === quantity) || null;
  }

  function offer() {
    const types = [...new Set(known.spreads.map((one) => one.type))];
    element("unit-type").replaceChildren(...types.map((type) => new Option(type, type)));
  }

  function show(one) {
    state.spread = one;
    element("unit-type").value = one.type;
    const same = known.spreads.filter((other) => other.type === one.type);
    element("unit-quantity").replaceChildren(...same.map((other) => new Option(fleet.titleOf(other.quantity), String(other.quantity))));
    element("unit-quantity").value = String(one.quantity);
    state.rows = Array.from({ length: count }, (_, k) => k).filter(charted).sort((a, b) => table.value(a) - table.value(b));
    draw();
    if (list && list.state.way === "those of the chart") list.sift();
  }

  function draw() {
    const { rows, spread: one } = state, x = rows.map((_, k) => k + 1), reach = (k) => 1.96 * table.standard_error(k);
    for (const [name, outside] of [["within", 0], ["outside", 1]]) {
      const mine = rows.map((row, k) => [row, x[k]]).filter(([row]) => table.outside(row) === outside);
      const by = (of) => mine.map(([row]) => of(row));
      charts.fill(name, {
        x: mine.map(([, k]) => k), beside: mine.map(([, k]) => k + 0.35), row: by((row) => row), value: by(table.value),
        lower: by((k) => table.value(k) - reach(k)), upper: by((k) => table.value(k) + reach(k)), shrunken: by(table.shrunken),
      });
    }
    charts.named("mean").location = one.mean;
    charts.named("spread").setv({ bottom: one.low, top: one.high });
    const core = [...rows.map(table.value), one.low, one.high], [least, most] = [Math.min(...core), Math.max(...core)];
    const ends = rows.flatMap((k) => [table.value(k) - reach(k), table.value(k) + reach(k)]);
    const near = ends.filter((y) => y > least - (most - least) && y < most + (most - least));
    charts.frame("units", "y_range", Math.min(least, ...near), Math.max(most, ...near));
    charts.frame("units", "x_range", 0.5, rows.length + 0.7, 0.01);
    told();
    point(charted(state.row) ? state.row : -1);
  }

  function told() {
    const { rows, spread: one } = state, { label: name, unit } = fleet.quantity(one.quantity), outside = rows.filter((k) => table.outside(k)).length;
    const part = rows.length < one.count ? ` The chart has ${rows.length} of them, those farthest from the mean.` : "";
    const said = `Type ${one.type}, ${name}: ${outside} of ${fleet.counted(one.count, "unit")} outside; mean ${fleet.withUnit(fleet.number(one.mean), unit)}, spread between units ${fleet.number(one.spread, 2)} %.${part}`;
    fleet.text("units-said", said);
    charts.titles("units", "Units of the type, ordered by value", `${fleet.titleOf(one.quantity)}${unit ? ` (${unit})` : ""}`);
    charts.label("units", said);
  }

  // Whose a value is: in words below the chart, and circled in it.
  function point(k) {
    const place = state.rows.indexOf(k);
    charts.fill("here", place < 0 ? { x: [], value: [] } : { x: [place + 1], value: [table.value(k)] });
    if (place < 0) return;
    const { unit } = fleet.quantity(table.quantity(k));
    fleet.text("unit-said", `${table.unit(k)}, joint ${table.joint(k)}: ${label(k)} ${fleet.withUnit(own(k), unit)}, ${fleet.signed(table.percent(k))} % from the mean (${finding(k)}); shrunken ${fleet.withUnit(drawn(k), unit)}, of which ${fleet.number(table.borrowed_percent(k), 3)} % is borrowed.`);
  }

  function choose(k) {
    state.row = k;
    const one = spread(table.type(k), table.quantity(k));
    if (one && one !== state.spread) show(one);
    else if (one) point(k);
  }

  function start() {
    list = fleet.paged({ name: "units", count, cells: CELLS, words, keep: { label: "Show", ways: WAYS }, choose });
    if (!known.spreads.length || !count) return;
    element("unit-panel").hidden = false;
    offer();
    element("unit-type").addEventListener("change", (event) => {
      const { quantity } = state.spread;
      show(spread(event.target.value, quantity) || known.spreads.find((one) => one.type === event.target.value));
    });
    element("unit-quantity").addEventListener("change", (event) => show(spread(state.spread.type, Number(event.target.value))));
    for (const name of ["within", "outside"]) {
      const source = charts.named(name);
      source.inspect.connect(() => {
        const { indices } = source.inspected;
        if (indices.length) point(source.data.row[indices[0]]);
      });
    }
    list.pick(0);
    if (state.spread === null) show(known.spreads[0]);
  }

  return { show, start, state, table };
})();
