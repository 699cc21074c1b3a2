// View 5: the cost over any two parameters, the profile of v_s, and correlations of the estimates.
"use strict";
explorer.views.identifiability = (() => {
  const { FIELDS, array, bound, costOf, element, fill, fitsOf, identified, isPassive, joint, label, named, option, pair, set, settings, shown, state, text, titles, truth, unitOf, views } = explorer;
  const CELLS = { points: 35, run: 17 }; // along either axis
  const STEPS = [0.1, 0.3, 1, 3, 10, 30, 100]; // changes of cost, where each colour ends
  const COLOURS = ["#fde725", "#8fd744", "#35b779", "#21908d", "#31688e", "#443a83", "#440154", "#2b0138"];
  const CHUNK = 12; // ms between two looks at the user
  let asked = 0;

  const along = () => (state.direction === "both" ? "+" : state.direction);
  const unitText = (name) => `${settings.symbols[name]} (${unitOf(name)})`;

  // The range of an axis: some half-widths of the 95 % interval about the identified value, or a share of it.
  function reach(name) {
    const row = set().values[state.direction][name], [low, high] = (row.interval || [NaN, NaN]).map(bound), by = option("map-width");
    const own = Number.isFinite(high - low) && high > low ? (high - low) / 2 : 0.1 * (row.value || joint().ranges[name].high / 4);
    const floor = joint().ranges[name].log ? row.value / 100 : 0;
    return [Math.max(row.value - by * own, floor), row.value + by * own];
  }

  function costBy(data) {
    if (data === "points") {
      const fits = fitsOf(state.direction);
      return fits.length ? (p) => fits.reduce((sum, fit) => sum + costOf(fit, p), 0) : null;
    }
    if (!joint().moving) return null;
    return (p) => views.response.left(p).error.reduce((sum, r) => sum + r * r, 0);
  }

  // What a change of cost is counted in: up to the 95 % threshold of one parameter, (3.84 / (n - p)) of the least where none is known.
  function scale(data) {
    const fits = fitsOf(state.direction);
    if (data === "points" && fits.every((fit) => fit.threshold !== null)) {
      return { least: fits.reduce((sum, fit) => sum + fit.least, 0), by: Math.max(...fits.map((fit) => fit.threshold - fit.least)) };
    }
    const least = costBy(data)(identified()), n = data === "points" ? fits.reduce((sum, fit) => sum + fit.velocity.length, 0) : joint().moving.velocity.length;
    return { least, by: 3.84 * least / Math.max(n - 4, 1) };
  }

  function colour(change) {
    const k = STEPS.findIndex((end) => change <= end);
    return COLOURS[k < 0 ? STEPS.length : k];
  }

  function moved(name, x, other, y) {
    const p = pair(), d = along(), own = { ...p[d], [name]: x, [other]: y };
    return state.direction === "both" ? { "+": own, "-": own } : { ...p, [d]: own };
  }

  async function map() {
    const job = ++asked, [a, b] = [option("map-x"), option("map-y")], data = option("map-data"), cost = costBy(data);
    const progress = element("map-progress");
    progress.hidden = true;
    marks(a, b);
    if (a === b || !cost) {
      for (const name of ["unlikely", "active"]) fill(name, { x: [], y: [], width: [], height: [], colour: [], ink: [] });
      text("map-said", a === b ? "Choose two different parameters." : "These data were not measured on this joint.");
      return;
    }
    const n = CELLS[data], [x0, x1] = reach(a), [y0, y1] = reach(b), { least, by } = scale(data);
    const width = (x1 - x0) / n, height = (y1 - y0) / n, cells = [];
    let since = performance.now(), lowest = Infinity, highest = 0;
    for (let k = 0; k < n * n; k++) {
      const x = x0 + (k % n + 0.5) * width, y = y0 + (Math.floor(k / n) + 0.5) * height, p = moved(a, x, b, y);
      const change = (cost(p) - least) / by;
      lowest = Math.min(lowest, change);
      highest = Math.max(highest, change);
      cells.push({ x, y, change, active: !isPassive(p[along()]) });
      if (performance.now() - since > CHUNK) {
        progress.hidden = false;
        progress.value = k / (n * n);
        await new Promise((resume) => setTimeout(resume));
        if (job !== asked) return;
        since = performance.now();
      }
    }
    progress.hidden = true;
    const columns = (rows) => ({
      x: rows.map((c) => c.x), y: rows.map((c) => c.y), width: rows.map(() => 1.02 * width), height: rows.map(() => 1.02 * height),
      colour: rows.map((c) => colour(c.change)), ink: rows.map((c) => (c.change <= 3 ? "#000000" : "#ffffff")),
    });
    fill("unlikely", columns(cells));
    fill("active", columns(cells.filter((c) => c.active)));
    const within = cells.filter((c) => c.change <= 1).length, active = cells.filter((c) => c.active).length, flat = highest - lowest < 1e-9;
    const words = flat ? "These data say nothing of either parameter: the cost is the same everywhere."
      : `${within} of ${cells.length} cells are within the 95 % threshold of one parameter; the other parameters stay at these values. `
        + `${active ? `Hatched: ${active === cells.length ? "all" : active} are not passive. ` : ""}`
        + (data === "run" ? "Of the moving run the threshold is that of independent residuals, which they are not: the true region is wider." : "");
    text("map-said", words);
    element("map-said").dataset.job = String(job);
    label("map", `Cost over ${a} and ${b}. ${words}`);
  }

  function marks(a, b) {
    const d = along(), real = truth(), at = (p) => ({ x: [p[d][a]], y: [p[d][b]], place: [""] });
    fill("map.now", at(pair()));
    fill("map.identified", at(identified()));
    fill("map.truth", real ? at(real) : { x: [], y: [], place: [] });
    titles("map", unitText(a), unitText(b));
  }

  function profile() {
    const fit = fitsOf(state.direction)[0], here = pair()[along()].v_s;
    named("threshold").visible = Boolean(fit && fit.threshold !== null);
    element("figure-profile").hidden = !fit;
    if (!fit) return;
    const [v, T, weight] = [array(fit.velocity), array(fit.target || fit.torque), array(fit.weight)], centre = identified()[along()].v_s;
    const near = fit.profile ? fit.profile.v_s : [centre / 2, 2 * centre], low = Math.min(near[0], here) / 1.2, high = 1.2 * Math.max(near[near.length - 1], here);
    const x = Float64Array.from({ length: 81 }, (_, k) => low * (high / low) ** (k / 80)), at = (v_s) => bristle.refit(v, T, weight, v_s).cost;
    fill("profile.now", { x, y: x.map(at) });
    fill("profile.written", { x: fit.profile ? fit.profile.v_s : [], y: fit.profile ? fit.profile.cost : [], place: (fit.profile ? fit.profile.v_s : []).map(() => "") });
    fill("profile.here", { x: [here], y: [at(here)], place: [""] });
    if (fit.threshold !== null) named("threshold").location = fit.threshold;
    const words = `At vₛ = ${shown(here)} ${unitOf("v_s")} the cost is ${shown(at(here))} with α₀, α₁, α₂ refitted`
      + (fit.threshold === null ? "." : `; least ${shown(fit.least)}, 95 % threshold ${shown(fit.threshold)} (dashed).`);
    text("profile-said", words);
    label("profile", `Profile of the cost over v_s. ${words}`);
    titles("profile", unitText("v_s"), `Cost (${unitOf("torque")})²`);
  }

  function correlations() {
    const own = joint().correlations[Number(element("correlation").value) || 0], head = element("correlation-head"), body = element("correlation-rows");
    const cell = (tag, words, scope) => Object.assign(document.createElement(tag), { textContent: words, ...(scope ? { scope } : {}) });
    head.replaceChildren();
    body.replaceChildren();
    if (!own) return;
    const name = (x) => x.replace(/^(alpha_[012]|v_s|sigma_[01])/, (found) => settings.symbols[found]);
    head.append(cell("th", "", "col"), ...own.names.map((x) => cell("th", name(x), "col")));
    body.append(...own.matrix.map((row, k) => {
      const line = document.createElement("tr");
      line.append(cell("th", name(own.names[k]), "row"), ...row.map((x) => {
        const one = cell("td", x.toFixed(2));
        one.style.background = `rgba(${x < 0 ? "213,94,0" : "0,114,178"},${(0.55 * Math.abs(x)).toFixed(3)})`;
        return one;
      }));
      return line;
    }));
  }

  function draw() {
    profile();
    return map();
  }

  function drawJoint() {
    const field = element("correlation");
    field.replaceChildren(...joint().correlations.map((one, k) => new Option(one.label, String(k))));
    correlations();
    for (const one of element("map-data").options) one.disabled = !costBy(one.value);
    const chosen = element("map-data");
    if (!costBy(chosen.value)) chosen.value = chosen.value === "points" ? "run" : "points";
    const key = element("map-key");
    const swatch = (colour_, words) => {
      const item = document.createElement("li"), box = document.createElement("span");
      box.className = "swatch";
      box.style.background = colour_;
      item.append(box, ` ${words}`);
      return item;
    };
    key.replaceChildren(...COLOURS.map((x, k) => swatch(x, k < STEPS.length ? `≤ ${STEPS[k]}` : `> ${STEPS[k - 1]}`)));
  }

  for (const [id, first] of [["map-x", "v_s"], ["map-y", "alpha_1"]]) {
    element(id).replaceChildren(...FIELDS.map((name) => new Option(settings.symbols[name], name)));
    element(id).value = first;
  }

  return { draw, joint: drawJoint, chosen: (id) => { if (id === "correlation" || !id) correlations(); } };
})();
