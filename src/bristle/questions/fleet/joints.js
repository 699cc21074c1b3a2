// The joints, ranked; of the chosen one its parameters over the sessions.
"use strict";
fleet.joints = (() => {
  const { charts, element, known, make } = fleet;
  const table = fleet.columns(known.joints), count = table.rank.count;
  const series = Object.fromEntries(Object.entries(known.series).filter(([name]) => name !== "steps").map(([name, one]) => [name, fleet.numbers(one)]));
  const steps = fleet.columns(known.series.steps);
  const NONE = 65535;
  const state = { joint: -1, block: -1 };

  // Where the sessions of each joint begin, where the values of each block do, and the blocks of each joint.
  const visits = [0];
  for (const n of series.counts) visits.push(visits.at(-1) + n);
  const begins = [0], blocks = new Map();
  series.joint.forEach((joint, block) => {
    begins.push(begins.at(-1) + series.counts[joint]);
    if (!blocks.has(joint)) blocks.set(joint, []);
    blocks.get(joint).push(block);
  });

  const at = (name, block, k) => {
    const code = series[name][begins[block] + k];
    return code === NONE ? NaN : series.low[block] + code * series.step[block];
  };

  function finding(k) {
    const said = table.changed(k) ? "changed" : table.untested(k) ? `not tested: ${table.untested(k)}` : "no change found";
    return table.outside(k) ? `${said}; outside its type` : said;
  }

  function report(k) {
    if (table.link(k)) return make("a", { href: table.link(k) }, "report");
    return table.command(k) ? fleet.copier(table.command(k), `Copy the command that makes the report of ${table.unit(k)} ${table.joint(k)}`) : "";
  }

  const size = (k) => fleet.change(table.percent(k), table.percent_lower(k), table.percent_upper(k));
  const after = (k) => fleet.number(table.sessions_after(k));
  const CELLS = [
    { show: (k) => String(table.rank(k)), by: table.rank, kind: "n" },
    { show: (k) => make("button", { type: "button", className: "choose" }, table.unit(k)), by: table.unit, kind: "name" },
    { show: table.joint, by: table.joint, kind: "name" },
    { show: (k) => make("span", { className: table.changed(k) ? "finding" : "" }, finding(k)), by: finding, kind: "text" },
    { show: size, by: table.percent, kind: "n" },
    { show: table.label, by: table.label, kind: "s" },
    { show: (k) => fleet.day(table.since(k)), by: table.since, kind: "s" },
    { show: (k) => fleet.probability(table.adjusted_p(k)), by: table.adjusted_p, kind: "n" },
    { show: (k) => fleet.codes(table.warned(k)), by: table.warned, kind: "text" },
    { show: report, by: table.link, kind: "s" },
    { show: after, by: table.sessions_after, kind: "n" },
    { show: table.type, by: table.type, kind: "name" },
  ];
  const words = (k) => [table.unit(k), table.joint(k), table.type(k), table.label(k), table.warned(k), finding(k)].join(" ").toLowerCase();
  const WAYS = {
    "all joints": () => true,
    changed: (k) => table.changed(k) === 1,
    "with new warnings": (k) => table.warned(k) !== "",
    "outside their type": (k) => table.outside(k) === 1,
    "not tested": (k) => table.untested(k) !== "",
  };

  // ---- the chosen joint

  function said(k) {
    const anew = k < series.counts.length && series.sessions[visits[k]] < table.first(k) - 1;
    const sessions = `${fleet.counted(table.sessions(k), "session")}${anew ? ` since its baseline began anew on ${fleet.day(table.first(k))}` : ""}`;
    if (table.untested(k)) return `${sessions}. Not tested for a change: ${table.untested(k)}.`;
    const step = `${table.label(k)} by ${size(k)} % since ${fleet.day(table.since(k))}, adjusted p ${fleet.probability(table.adjusted_p(k))}`;
    if (!table.changed(k)) return `${sessions}. No change is named; the most likely step is ${step}.`;
    return `${sessions}, ${after(k)} of them since the change. Changed: ${step}.`;
  }

  function warned(k) {
    const place = element("joint-warned");
    place.hidden = !table.warned(k);
    if (place.hidden) return;
    place.replaceChildren(
      "Warnings that begin with the step: ", fleet.codes(table.warned(k)),
      ". They point at the log, its sensors or its sampling, and not at wear: look at the session's report first.",
    );
  }

  function reported(k) {
    const place = element("joint-report");
    if (table.link(k)) place.replaceChildren("Its latest session: ", make("a", { href: table.link(k) }, "report"));
    else if (table.command(k)) {
      place.replaceChildren(
        `The report of its latest session, ${fleet.day(table.latest(k))}: `, make("code", { className: "command" }, table.command(k)), " ",
        fleet.copier(table.command(k), "Copy this command"),
      );
    } else place.replaceChildren();
  }

  function choose(k) {
    state.joint = k;
    element("joint-panel").hidden = false;
    fleet.text("joint-title", `${table.unit(k)}, joint ${table.joint(k)}${table.type(k) === table.joint(k) ? "" : ` of type ${table.type(k)}`}`);
    fleet.text("joint-said", said(k));
    warned(k);
    reported(k);
    const own = blocks.get(k) || [], choice = element("joint-quantity");
    choice.replaceChildren(...own.map((block) => new Option(fleet.titleOf(series.quantity[block]), String(block))));
    for (const id of ["figure-time", "table-steps"]) element(id).hidden = !own.length;
    choice.parentElement.hidden = !own.length;
    rows(own);
    if (!own.length) {
      const none = k < known.charted ? "No values of this joint can be drawn." : "This page has no chart of this joint; the dataset has its values.";
      return fleet.text("time-said", none);
    }
    const clearest = own.find((block) => fleet.quantity(series.quantity[block]).label === table.label(k));
    draw(clearest === undefined ? own[0] : clearest);
  }

  const stepOf = (block) => fleet.change(steps.percent(block), steps.percent_lower(block), steps.percent_upper(block));
  function rows(own) {
    element("table-steps").tBodies[0].replaceChildren(...own.map((block) => {
      const { label, unit } = fleet.quantity(series.quantity[block]), tested = Number.isFinite(steps.p(block));
      const verdict = tested ? (steps.changed(block) === 1 ? "yes" : "no") : "not tested";
      const shown = [
        [label], [fleet.number(steps.before(block)), "n"], [fleet.number(steps.after(block)), "n"], [unit, "s"], [stepOf(block), "n"],
        [fleet.day(steps.since(block)), "s"], [fleet.probability(steps.p(block)), "n"], [verdict, "s"],
      ];
      const [first, ...others] = shown;
      return make("tr", {}, make("th", { scope: "row" }, ...first), ...others.map(([cell, kind]) => make("td", { className: kind || "" }, cell)));
    }));
  }

  // Two points of a level that holds from one session to another, half a step beyond them.
  function level(name, block, from, to, x) {
    const y = steps[name](block);
    charts.fill(name, Number.isFinite(y) && from < to ? { x: [x[from], x[to - 1]], y: [y, y] } : { x: [], y: [] });
    return y;
  }

  function draw(block) {
    state.block = block;
    element("joint-quantity").value = String(block);
    const joint = series.joint[block], n = series.counts[joint], own = Array.from({ length: n }, (_, k) => k);
    const x = [...series.sessions.subarray(visits[joint], visits[joint] + n)];
    const named = ["value", "lower", "upper", "adjusted", "limit_low", "limit_high"];
    const data = Object.fromEntries(named.map((name) => [name, own.map((k) => at(name, block, k))]));
    charts.fill("points", { x, ...data });
    const limited = own.filter((k) => Number.isFinite(data.limit_low[k]) && Number.isFinite(data.limit_high[k]));
    charts.fill("limits", { x: limited.map((k) => x[k]), y1: limited.map((k) => data.limit_low[k]), y2: limited.map((k) => data.limit_high[k]) });
    const since = steps.since(block), place = x.findIndex((ms) => ms >= since - 1), step = charts.named("step");
    const there = place > 0, begun = Math.max(x.findIndex((ms) => ms >= table.first(joint) - 1), 0);
    step.setv({ visible: there, location: there ? (x[place - 1] + x[place]) / 2 : x[0] });
    charts.named("begun").setv({ visible: begun > 0, location: begun > 0 ? (x[begun - 1] + x[begun]) / 2 : x[0] });
    const levels = [level("before", block, begun, there ? place : 0, x), level("after", block, there ? place : 0, there ? n : 0, x)];
    ranges(data, levels, x);
    const { label, unit } = fleet.quantity(series.quantity[block]);
    charts.titles("time", "Session (UTC)", `${fleet.titleOf(series.quantity[block])}${unit ? ` (${unit})` : ""}`);
    const words = Number.isFinite(steps.p(block))
      ? `${label}: the most likely step is ${stepOf(block)} % since ${fleet.day(since)}, p ${fleet.probability(steps.p(block))} of this test alone: ${steps.changed(block) === 1 ? "changed" : "no change found"}.`
      : `${label}: not tested for a change.`;
    fleet.text("time-said", words);
    charts.label("time", `${table.unit(joint)} ${table.joint(joint)} over ${fleet.counted(n, "session")}. ${words}`);
  }

  // What is drawn, but no end of an interval or limit farther than three times the range of the values.
  function ranges(data, levels, x) {
    const core = [...data.value, ...data.adjusted, ...levels].filter(Number.isFinite);
    const bars = data.value.map((_, k) => data.upper[k] - data.lower[k]).filter(Number.isFinite);
    const [least, most] = [Math.min(...core), Math.max(...core)], wide = Math.max(most - least, ...bars, 1e-9 * Math.abs(most));
    const ends = ["lower", "upper", "limit_low", "limit_high"].flatMap((name) => data[name]).filter((y) => y > least - 3 * wide && y < most + 3 * wide);
    charts.frame("time", "y_range", Math.min(least, ...ends), Math.max(most, ...ends));
    const days = x.length > 1 ? 0 : 2 * 86400000;
    charts.frame("time", "x_range", x[0] - days, x.at(-1) + days, 0.03);
  }

  function start() {
    const { pick } = fleet.paged({ name: "joints", count, cells: CELLS, words, keep: { label: "Show", ways: WAYS }, choose });
    element("joint-quantity").addEventListener("change", (event) => draw(Number(event.target.value)));
    if (count) pick(0);
  }

  return { draw, start, state, table };
})();
