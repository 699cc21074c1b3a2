// View 5: the cost over any two parameters, the profile of v_s, and correlations of the estimates.
"use strict";
explorer.views.identifiability = (() => {
  const { array, bound, comparable, element, fill, fitsOf, fix, identified, joint, label, listed, made, named, option, pair, row, set, settings, shown, sliders, state, text, titles, truth, unitOf } = explorer;
  const CELLS = { points: 35, run: 17 }; // along either axis
  const STEPS = [0.1, 0.3, 1, 3, 10, 30, 100]; // changes of cost, where each colour ends
  const COLOURS = ["#fde725", "#8fd744", "#35b779", "#21908d", "#31688e", "#443a83", "#440154", "#2b0138"];
  let jobs = 0, asked = null, drawn = "", worker; // asked: the map that is being computed

  const along = () => (state.direction === "both" ? "+" : state.direction);
  const unitText = (name) => `${settings.symbols[name]} (${unitOf(name)})`;

  // The range of an axis: some half-widths of the 95 % interval about the identified value, or a share of it.
  function reach(name) {
    const row = set().values[state.direction][name], [low, high] = (row.interval || [NaN, NaN]).map(bound), by = option("map-width");
    const own = Number.isFinite(high - low) && high > low ? (high - low) / 2 : 0.1 * (Math.abs(row.value) || joint().ranges[name].high / 4);
    const floor = joint().ranges[name].log ? row.value / 100 : bound(joint().ranges[name].least);
    return [Math.max(row.value - by * own, floor), row.value + by * own];
  }

  // What a cost is of; null where it was not measured.
  function dataOf(data) {
    if (data === "run") return joint().moving && { moving: joint().moving };
    const fits = fitsOf(state.direction);
    return fits.length ? { fits } : null;
  }

  function colour(change) {
    const k = STEPS.findIndex((end) => change <= end);
    return COLOURS[k < 0 ? STEPS.length : k];
  }

  // The worker, of the very scripts of this page; null where none can be made: maps are then computed here, in slices.
  function created() {
    try {
      const texts = ["bristle", "costs"].map((name) => element(`script-${name}`).textContent);
      const one = new Worker(URL.createObjectURL(new Blob(texts, { type: "text/javascript" })));
      one.onmessage = ({ data }) => heard(data);
      one.onerror = () => {
        worker = null;
        if (asked) ask(asked);
      };
      return one;
    } catch {
      return null;
    }
  }

  // Ask for a map in place of the one that is being computed; null: for none.
  function ask(request) {
    asked = request;
    element("figure-map").ariaBusy = String(Boolean(request));
    if (!request) element("map-progress").hidden = true;
    if (worker === undefined) worker = created();
    if (worker) worker.postMessage(request);
    else costs.map(request, heard);
  }

  function heard({ job, part, cells }) {
    if (!asked || job !== asked.job) return;
    const progress = element("map-progress");
    progress.hidden = Boolean(cells);
    progress.value = part || 0;
    if (cells) paint(cells);
    else text("map-said", `Computing the cost map: ${25 * Math.floor(4 * part)} %.`); // said four times, not at every step
  }

  function leave() {
    if (asked) ask(null);
  }

  function map() {
    const names = [option("map-x"), option("map-y")], data = option("map-data"), of = dataOf(data), d = state.direction;
    const subject = [state.joint, state.set, d, data, ...names].join(" "), different = names[0] !== names[1];
    marks(...names);
    if (subject !== drawn) {
      fill("unlikely", { x: [], y: [], width: [], height: [], colour: [] });
      fill("active", hatched([]));
    }
    drawn = subject;
    if (different && of) {
      jobs += 1;
      ask({ job: jobs, n: CELLS[data], names, ends: names.map(reach), pair: pair(), directions: d === "both" ? ["+", "-"] : [d], identified: identified(), ...of });
    } else {
      leave();
      text("map-said", different ? "These data were not measured on this joint." : "Choose two different parameters.");
    }
  }

  function paint(cells) {
    const { n, names: [a, b], ends: [[x0, x1], [y0, y1]], moving } = asked, width = (x1 - x0) / n, height = (y1 - y0) / n;
    fill("unlikely", {
      x: cells.map((c) => c.x), y: cells.map((c) => c.y), width: cells.map(() => 1.02 * width), height: cells.map(() => 1.02 * height),
      colour: cells.map((c) => colour(c.change)),
    });
    fill("active", hatched(cells.filter((c) => c.active), width / 2, height / 2));
    const changes = cells.map((c) => c.change), flat = Math.max(...changes) - Math.min(...changes) < 1e-9;
    const within = cells.filter((c) => c.change <= 1).length, active = cells.filter((c) => c.active).length;
    const words = flat ? "These data say nothing of either parameter: the cost is the same everywhere."
      : `${within} of ${cells.length} cells are within the 95 % threshold of one parameter; the other parameters stay at these values. `
        + `${active ? `Hatched: ${active === cells.length ? "all" : active} are not passive. ` : ""}`
        + (moving ? "Of the moving run the threshold is that of independent residuals, which they are not: the true region is wider." : "");
    text("map-said", words);
    label("map", `Cost over ${a} and ${b}. ${words}`);
    asked = null;
    element("figure-map").ariaBusy = "false";
  }

  // All cells of one ink as one shape: each shape takes a hatch of its own, which takes 2 ms.
  function hatched(cells, w, h) {
    const inks = [["#000000", cells.filter((c) => c.change <= 3)], ["#ffffff", cells.filter((c) => c.change > 3)]].filter(([, own]) => own.length);
    return {
      xs: inks.map(([, own]) => own.flatMap(({ x }) => [x - w, x + w, x + w, x - w, NaN])),
      ys: inks.map(([, own]) => own.flatMap(({ y }) => [y - h, y - h, y + h, y + h, NaN])),
      ink: inks.map(([ink]) => ink),
    };
  }

  function marks(a, b) {
    const d = along(), real = comparable() && truth(), at = (p) => ({ x: [p[d][a]], y: [p[d][b]], place: [""] });
    fill("map.now", at(pair()));
    fill("map.identified", at(identified()));
    fill("map.truth", real ? at(real) : { x: [], y: [], place: [] });
    titles("map", unitText(a), unitText(b));
    for (const [axis, name] of [["x_range", a], ["y_range", b]]) { // the whole map and all marks
      const all = [...reach(name), ...[pair(), identified(), real].filter(Boolean).map((p) => p[d][name])];
      const low = Math.min(...all), high = Math.max(...all), margin = 0.05 * (high - low);
      fix("map", axis, low - margin, high + margin);
    }
  }

  function profile() {
    const fit = fitsOf(state.direction)[0], now = pair(), own = now[along()], here = own.v_s;
    named("threshold").visible = Boolean(fit && fit.threshold !== null);
    element("figure-profile").hidden = !fit;
    if (!fit) return;
    const [v, T] = [array(fit.velocity), array(fit.torque)], centre = identified()[along()].v_s;
    const near = fit.profile ? fit.profile.v_s : [centre / 2, 2 * centre], low = Math.min(near[0], here) / 1.2, high = 1.2 * Math.max(near[near.length - 1], here);
    const x = Float64Array.from({ length: 81 }, (_, k) => low * (high / low) ** (k / 80)), at = (v_s) => bristle.refit(v, T, now.law, { ...own, v_s }).cost;
    fill("profile.now", { x, y: x.map(at) });
    fill("profile.written", { x: fit.profile ? fit.profile.v_s : [], y: fit.profile ? fit.profile.cost : [], place: (fit.profile ? fit.profile.v_s : []).map(() => "") });
    fill("profile.here", { x: [here], y: [at(here)], place: [""] });
    if (fit.threshold !== null) named("threshold").location = fit.threshold;
    const words = `At vₛ = ${shown(here)} ${unitOf("v_s")} the cost is ${shown(at(here))} with ${listed(bristle.laws[now.law].COEFFICIENTS)} refitted`
      + (fit.threshold === null ? "." : `; least ${shown(fit.least)}, 95 % threshold ${shown(fit.threshold)} (dashed).`);
    text("profile-said", words);
    label("profile", `Profile of the cost over v_s. ${words}`);
    titles("profile", unitText("v_s"), `Cost (${unitOf("torque")})²`);
  }

  function correlations() {
    const own = joint().correlations[Number(element("correlation").value) || 0] || { names: [], matrix: [] };
    const names = own.names.map((x) => x.replace(/^[^+-]+/, (found) => settings.symbols[found] ?? found));
    element("correlation-head").replaceChildren(...["", ...names].map((x) => made("th", x, { scope: "col" })));
    element("correlation-rows").replaceChildren(...own.matrix.map((numbers, k) => {
      const line = row(names[k], numbers.map((x) => x.toFixed(2)));
      numbers.forEach((x, i) => { line.cells[i + 1].style.background = `rgba(${x < 0 ? "213,94,0" : "0,114,178"},${(0.55 * Math.abs(x)).toFixed(3)})`; });
      return line;
    }));
  }

  function draw() {
    profile();
    map();
  }

  function drawJoint() {
    const field = element("correlation");
    field.replaceChildren(...joint().correlations.map((one, k) => new Option(one.label, String(k))));
    correlations();
    for (const [id, first] of [["map-x", "v_s"], ["map-y", "alpha_1"]]) {
      const axis = element(id), before = axis.value;
      axis.replaceChildren(...sliders().map((name) => new Option(settings.symbols[name], name)));
      axis.value = sliders().includes(before) ? before : first;
    }
    for (const one of element("map-data").options) one.disabled = !dataOf(one.value);
    const chosen = element("map-data");
    if (!dataOf(chosen.value)) chosen.value = chosen.value === "points" ? "run" : "points";
    element("map-key").replaceChildren(...COLOURS.map((x, k) => {
      const item = made("li", k < STEPS.length ? ` ≤ ${STEPS[k]}` : ` > ${STEPS[k - 1]}`), swatch = made("span", "", { className: "swatch" });
      swatch.style.background = x;
      item.prepend(swatch);
      return item;
    }));
  }

  return { draw, leave, joint: drawJoint, chosen: (id) => { if (id === "correlation" || !id) correlations(); } };
})();
