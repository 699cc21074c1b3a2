// View 4: the joint in its loop, with the friction model of the sliders: its factors as they adapt, and the error they leave.
"use strict";
explorer.views.compensation = (() => {
  const { effort, element, fill, identified, joint, label, made, named, option, pair, row, settings, shown, text, titles, unitOf } = explorer;
  const DRAWN = 2500; // samples of a run, at the most
  const NUMBERS = { "loop-amplitude-": "amplitude", "loop-frequency": "frequency", "loop-duration": "duration" };
  const GAINS = { "gain-p": "K_p", "gain-i": "K_i", "gain-d": "K_d" };
  const paper = Object.entries(settings.paper); // to which the factors of its Table 2 converge
  const PLACES = [0, 1]; // adapted parameters that have entries here; further ones stay as they are

  const plan = () => {
    const plans = joint().loop;
    return Array.isArray(plans) ? plans[Math.min(Number(element("plan").value) || 0, plans.length - 1)] : null;
  };

  // The model that the compensator has: the joint's own, by the ratio of each slider to its identified value.
  function model({ options, one_way }) {
    const now = pair(), then = identified();
    const scaled = (d) => {
      const of = one_way ? "+" : d;
      const ratio = (name) => (then[of][name] ? now[of][name] / then[of][name] : 1);
      return Object.fromEntries(Object.entries(options.model[d]).map(([name, x]) => [name, x * ratio(name)]));
    };
    return { ...options.model, "+": scaled("+"), "-": scaled("-") };
  }

  function asked() {
    const chosen = plan(), own = chosen.options, options = { ...own, model: model(chosen), gains: { ...own.gains }, gamma: { ...own.gamma }, start: { ...own.start } };
    for (const [id, name] of Object.entries(NUMBERS)) options[name] = option(id);
    for (const [id, name] of Object.entries(GAINS)) options.gains[name] = option(id);
    const law = option("law");
    options.law = Object.hasOwn(own.laws, law) ? law : own.law;
    const gamma = own.gamma[options.law]; // of a law that adapts
    if (gamma) options.gamma[options.law] = gamma.map((x, k) => (k < PLACES.length ? option(`gamma-${k}`) : x));
    for (const k of PLACES) {
      if (k < own.parameters.length) options.start[own.parameters[k]] = option(`start-${k}`);
    }
    options.settle = Math.min(own.settle, options.duration / 2);
    return options;
  }

  function thinned(t, y) {
    const by = Math.max(1, Math.ceil(t.length / DRAWN)), keep = (x) => x.filter((_, k) => k % by === 0);
    return { x: keep(t), y: keep(y) };
  }

  const none = { x: [], y: [] };

  function draw() {
    if (!plan()) return;
    const options = asked(), start = options.start;
    const runs = {
      none: bristle.closedLoop({ ...options, law: "none", start: {} }),
      model: bristle.closedLoop({ ...options, law: "fixed", start: {} }),
      fixed: bristle.closedLoop({ ...options, law: "fixed", start }),
      adaptive: bristle.closedLoop({ ...options, start }),
    };
    const own = runs.adaptive, adapts = options.law !== "none" && options.law !== "fixed";
    for (const [mark, name] of [["theta_1", options.parameters[0]], ["theta_2", options.parameters[1]]]) {
      fill(mark, adapts && own.factors[name] ? thinned(own.time, own.factors[name]) : none);
    }
    fill("loop_error.none", thinned(runs.none.time, runs.none.error));
    fill("loop_error.fixed", thinned(runs.fixed.time, runs.fixed.error));
    fill("loop_error.adaptive", adapts ? thinned(own.time, own.error) : none);
    fill("loop_torque.now", thinned(own.time, own.torque));
    for (const [name] of paper) named(name).visible = plan().one_way;
    const cut = Object.values(runs).map((run) => run.diverged).filter((t) => t !== null);
    named("cut").setv({ location: cut.length ? Math.min(...cut) : 0, visible: cut.length > 0 });
    told(options, runs, adapts);
  }

  function told(options, runs, adapts) {
    const rows = [
      ["without compensation", runs.none],
      ["fixed model: these values", runs.model],
      ["fixed model: these values times the start factors", runs.fixed],
      ...(adapts ? [[`adaptive (${options.law})`, runs.adaptive]] : []),
    ];
    const unit = unitOf("position");
    element("loop-rows").replaceChildren(...rows.map(([words, run]) => {
      const ratio = run.rms === null || !runs.none.rms ? NaN : run.rms / runs.none.rms;
      return row(words, [run.diverged === null ? `${shown(run.rms)} ${unit}` : `diverges at ${shown(run.diverged, 3)} s, cut there`, shown(ratio, 3)]);
    }));
    const last = (name) => { const x = runs.adaptive.factors[name]; return x && x.length ? x[x.length - 1] : null; };
    const ends = options.parameters.map((name) => [name, last(name)]).filter(([, x]) => x !== null);
    const said = element("compensation-said");
    for (const [name, x] of ends) said.dataset[name.replace("_", "")] = String(x);
    const parts = [];
    if (adapts) {
      parts.push(`Factors at ${shown(runs.adaptive.time[runs.adaptive.time.length - 1])} s: ${ends.map(([name, x]) => `${settings.symbols[name]} ${shown(x)}`).join(", ")}${plan().one_way ? ` (the paper: ${paper.map(([, x]) => x).join(" and ")}, dashed)` : ""}.`);
      const [best, got] = [runs.model.rms, runs.adaptive.rms];
      if (got !== null && best !== null && got > best) parts.push(`Adaptation leaves ${shown(got / best, 3)} times the error of the fixed model with these values.`);
    }
    if (Object.values(runs).some((run) => run.diverged !== null)) parts.push("A loop diverges: it is cut at the vertical line.");
    if (2 * Math.PI * options.frequency * options.amplitude > joint().speeds[1]) parts.push("The reference is faster than anything measured: extrapolated.");
    parts.push(`Runs of ${runs.none.time.length} control periods, every ${Math.max(1, Math.ceil(runs.none.time.length / DRAWN))}th drawn; errors count from ${shown(options.settle)} s on.`);
    text("compensation-said", parts.join(" "));
    label("gains", `Factors of the adapted parameters over time. ${parts[0]}`);
    label("loop_error", `Position error over time: ${rows.map(([words, run]) => `${words} ${run.rms === null ? "diverges" : `${shown(run.rms)} ${unit}`}`).join(", ")}.`);
    label("loop_torque", "Torque of the drive over time.");
  }

  const put = (id, x) => { element(id).defaultValue = String(x); element(id).value = String(x); };

  // The rates of the law that is chosen, as the plan has them.
  function rates() {
    const { gamma, law } = plan().options;
    (gamma[option("law")] || gamma[law]).slice(0, PLACES.length).forEach((x, k) => put(`gamma-${k}`, x));
  }

  // Entries of a plan: its own numbers.
  function entries() {
    const chosen = plan();
    element("loop-entries").hidden = !chosen;
    if (!chosen) return;
    const { options, assumptions } = chosen;
    for (const [id, name] of Object.entries(NUMBERS)) put(id, options[name]);
    element("loop-frequency").max = String(0.02 / options.period);
    element("loop-duration").max = String(60000 * options.period);
    for (const [id, name] of Object.entries(GAINS)) put(id, options.gains[name]);
    for (const k of PLACES) {
      const name = options.parameters[k];
      for (const what of ["gamma", "start"]) {
        element(`${what}-${k}-label`).hidden = name === undefined;
        text(`${what}-${k}-name`, name === undefined ? "" : settings.symbols[name]);
      }
      if (name === undefined) continue;
      put(`start-${k}`, options.start[name] ?? 1);
    }
    const law = element("law"), before = law.value, words = { none: "without compensation", fixed: "fixed model", printed: "(19)-(20) as printed" };
    law.replaceChildren(...Object.keys(options.laws).map((key) => new Option(words[key] || `adaptive, ${key}`, key)));
    law.value = Object.hasOwn(options.laws, before) ? before : options.law;
    rates();
    element("loop-assumptions").replaceChildren(...assumptions.map((x) => made("li", x)));
  }

  function drawJoint() {
    const plans = joint().loop, whole = Array.isArray(plans);
    element("plan").replaceChildren(...(whole ? plans : []).map((one, k) => new Option(one.label, String(k))));
    element("law").replaceChildren();
    text("no-loop", whole ? "" : plans);
    element("no-loop").hidden = whole;
    for (const name of ["gains", "loop_error", "loop_torque"]) element(`figure-${name}`).hidden = !whole;
    entries();
    titles("gains", "", "Ratio to these values");
    titles("loop_error", "", `Error (${unitOf("position")})`);
    titles("loop_torque", "Time (s)", effort());
    text("loop-unit", unitOf("position"));
    for (const [id, name] of Object.entries(GAINS)) text(`unit-${id}`, unitOf(name));
  }

  return { draw, joint: drawJoint, chosen: (id) => { if (id === "plan") entries(); else if (id === "law") rates(); } };
})();
