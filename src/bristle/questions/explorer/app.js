// What the page knows, what the user has chosen, and the controls; the views register themselves in `explorer.views`.
// No equation stands in these files: physics is asked of `bristle` and `costs`. Texts of users are set as text only.
"use strict";
const explorer = (() => {
  const { known, settings, document: model, roots } = JSON.parse(document.getElementById("data").textContent);
  const POSITIONS = 1000; // of a slider
  const views = {};
  const state = { joint: 0, set: 0, direction: "", values: {}, view: "friction" };
  let scheduled = false, bokeh = null;

  const element = (id) => document.getElementById(id);
  const joint = () => known.joints[state.joint];
  const set = () => joint().sets[state.set];
  const bound = (x) => (x === "inf" ? Infinity : x === "-inf" ? -Infinity : x);
  const unitOf = (name) => joint().units[name];
  const sliders = () => Object.keys(joint().ranges); // the parameters of the joint's law that have one
  const listed = (names) => names.map((name) => settings.symbols[name]).join(", ");

  // ---- numbers in print

  function shown(x, digits = 4) {
    if (x === null || x === undefined || Number.isNaN(x)) return "–";
    if (!Number.isFinite(x)) return x > 0 ? "∞" : "−∞";
    if (x === 0) return "0";
    const size = Math.abs(x);
    return size >= 1e-4 && size < 1e6 ? String(Number(x.toPrecision(digits))) : x.toExponential(digits - 1);
  }

  function text(id, words) {
    const place = element(id);
    if (place.textContent !== words) place.textContent = words;
  }

  const sign = (d) => (d === "-" ? "−" : d); // a direction
  const made = (tag, words, more = {}) => Object.assign(document.createElement(tag), { textContent: words, ...more });

  // A row of a table: what it is about, and its cells.
  function row(head, cells) {
    const line = document.createElement("tr");
    line.append(made("th", head, { scope: "row" }), ...cells.map((words) => made("td", words)));
    return line;
  }

  // The label of an axis of torque, or of force.
  const effort = () => `${joint().effort[0].toUpperCase()}${joint().effort.slice(1)} (${unitOf("torque")})`;

  // ---- parameter sets

  // One set per direction of motion, from values by the joint's own directions.
  function pairOf(values, law = joint().law) {
    const any = values.both || values["+"] || values["-"];
    return { law, "+": values["+"] || any, "-": values["-"] || any };
  }

  const plain = (rows) => Object.fromEntries(Object.entries(rows).map(([name, row]) => [name, row.value]));
  function valuesOf(one) {
    return Object.fromEntries(Object.entries(one.values).map(([d, rows]) => [d, plain(rows)]));
  }

  const pair = () => pairOf(state.values);
  const identified = () => pairOf(valuesOf(set()));
  function truth() {
    const found = joint().truth;
    if (!found) return null;
    const whole = Object.values(found).every((p) => Object.values(p).every((x) => x !== null));
    return whole ? pairOf(found, joint().truth_law) : null;
  }
  // True values of parameters that mean the same: those of the joint's own law.
  const comparable = () => (joint().truth_law === joint().law ? joint().truth : null);
  const truthOf = (name) => {
    const found = comparable();
    return found ? (found[state.direction] || found["+"] || found["-"])[name] : null;
  };

  // ---- constant-velocity fits

  const array = (x) => Float64Array.from(x);
  const fitsOf = (d) => joint().static.filter((fit) => d === "both" || fit.direction === "both" || fit.direction === d);
  const costOf = (fit, p) => costs.ofPoints([fit])(p);
  function errorOf(fit, p) {
    return 100 * Math.sqrt(bristle.cost(array(fit.velocity), array(fit.torque), p)) / fit.norm;
  }

  function refit() {
    const fits = fitsOf(state.direction);
    const all = (name) => array(fits.flatMap((fit) => fit[name]));
    const p = state.values[state.direction];
    const { law } = joint(), { COEFFICIENTS } = bristle.laws[law];
    if (!fits.length || all("velocity").length < COEFFICIENTS.length) return say("No points of constant velocity to refit to.");
    const found = bristle.refit(all("velocity"), all("torque"), law, p);
    if (!Number.isFinite(found.cost)) return say("No fit at this value of vₛ.");
    for (const name of COEFFICIENTS) p[name] = found[name];
    if (!(p.alpha_0 > 0)) p.alpha_0 = joint().ranges.alpha_0.low;
    changed();
    say(`Refitted at vₛ = ${shown(p.v_s)} ${unitOf("v_s")}: cost ${shown(found.cost, 5)}.`);
  }

  // ---- sliders

  function fraction(name, x) {
    const range = joint().ranges[name];
    const part = range.log ? Math.log(x / range.low) / Math.log(range.high / range.low) : (x - range.low) / (range.high - range.low);
    return Math.min(Math.max(Number.isFinite(part) ? part : 0, 0), 1);
  }

  function atFraction(name, part) {
    const range = joint().ranges[name];
    if (part <= 0) return range.low;
    if (part >= 1) return range.high;
    const x = range.log ? range.low * (range.high / range.low) ** part : range.low + part * (range.high - range.low);
    return Number(x.toPrecision(5));
  }

  // Of a number from outside: one that a parameter may have, or its fallback.
  function clamped(name, x, fallback) {
    const range = joint().ranges[name];
    const low = range.log ? range.low / 1000 : Math.max(1000 * range.low, bound(range.least));
    return Number.isFinite(x) ? Math.min(Math.max(x, low), range.high * 1000) : fallback;
  }

  function place(id, low, high) {
    const mark = element(id);
    mark.hidden = low === null;
    if (low === null) return;
    mark.style.left = `${100 * low}%`;
    if (high !== undefined) mark.style.width = `${Math.max(100 * (high - low), 1)}%`;
  }

  function showSlider(name) {
    const x = state.values[state.direction][name], row = set().values[state.direction][name], real = truthOf(name);
    const slider = element(`slider-${name}`), entry = element(`entry-${name}`);
    slider.value = Math.round(POSITIONS * fraction(name, x));
    slider.setAttribute("aria-valuetext", `${shown(x, 5)} ${unitOf(name)}`);
    if (document.activeElement !== entry) entry.value = Number(x.toPrecision(6));
    text(`unit-${name}`, unitOf(name));
    const ends = row.interval ? row.interval.map(bound) : null;
    if (ends) place(`interval-${name}`, fraction(name, ends[0]), fraction(name, ends[1]));
    else place(`interval-${name}`, null);
    place(`identified-${name}`, fraction(name, row.value));
    place(`true-${name}`, real === null ? null : fraction(name, real));
    const span = ends ? `95 % ${shown(ends[0])} to ${shown(ends[1])}` : "no interval";
    const off = ends && (x < ends[0] || x > ends[1]) ? ", outside" : "";
    const words = row.source === "assumed" ? "assumed, not identified" : `identified ${shown(row.value, 5)}, ${span}`;
    text(`said-${name}`, `${words}${off}${real === null ? "" : `; true ${shown(real)}`}`);
    element(`said-${name}`).classList.toggle("outside", Boolean(off));
  }

  // ---- figures

  const named = (name) => bokeh.get_model_by_name(name);
  function fill(name, columns) {
    named(name).data = columns;
    if (samples.has(name)) samples.get(name).hidden = !Object.values(columns)[0].length;
  }

  // The keys of the figures, of which a click hides and shows the marks.
  const samples = new Map([...document.querySelectorAll("[data-key]")].map((sample) => [sample.dataset.key, sample]));
  function toggle(name) {
    const sample = samples.get(name), visible = sample.getAttribute("aria-pressed") !== "true";
    sample.setAttribute("aria-pressed", String(visible));
    for (const id of Object.values(roots)) {
      for (const one of bokeh.get_model_by_id(id).renderers) if ([name, `${name}.held`].includes(one.data_source.name)) one.visible = visible;
    }
  }

  // Ranges of a figure that show all of these numbers with a margin; those of the last call stay where they do so and
  // are not far too wide.
  const frames = new Map();
  function frame(name, axis, numbers) {
    const finite = numbers.filter(Number.isFinite), low = Math.min(...finite), high = Math.max(...finite);
    if (!(high > low)) return;
    const key = `${name} ${axis}`, [from, to] = frames.get(key) || [NaN, NaN];
    if (low >= from && high <= to && high - low > 0.4 * (to - from)) return;
    const margin = 0.08 * (high - low), ends = [low - margin, high + margin];
    frames.set(key, ends);
    fix(name, axis, ...ends);
  }

  function fix(name, axis, start, end) {
    named(name)[axis].setv({ start, end, reset_start: start, reset_end: end });
  }

  function titles(name, x, y) {
    const plot = named(name);
    for (const axis of plot.below) if ("axis_label" in axis) axis.axis_label = x;
    for (const axis of plot.left) if ("axis_label" in axis) axis.axis_label = y;
  }

  function label(name, words) {
    element(`figure-${name}`).setAttribute("aria-label", words);
  }

  function colours() {
    const style = getComputedStyle(document.documentElement);
    const ink = style.getPropertyValue("--ink").trim(), line = style.getPropertyValue("--line").trim();
    for (const id of Object.values(roots)) {
      const plot = bokeh.get_model_by_id(id);
      for (const place of ["below", "left", "right", "above", "center"]) {
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

  // ---- the page

  function say(words) {
    text("status", words);
  }

  function summary() {
    const bad = Object.entries(state.values).filter(([, p]) => !bristle.isPassive(p, joint().law)).map(([d]) => sign(d));
    element("passivity").hidden = !bad.length;
    text("passivity", bad.length
      ? `Not passive in direction ${bad.join(" and ")}: with these values LuGre can generate energy in some motions.`
      : "");
  }

  function render() {
    scheduled = false;
    for (const name of sliders()) showSlider(name);
    summary();
    const view = views[state.view];
    if (view) view.draw();
    document.documentElement.dataset.drawn = String(Number(document.documentElement.dataset.drawn || 0) + 1);
  }

  function changed() {
    if (scheduled) return;
    scheduled = true;
    requestAnimationFrame(render);
  }

  // What may follow the curves, once the slider rests for a moment.
  let waiting = 0;
  function later(work) {
    clearTimeout(waiting);
    document.documentElement.dataset.pending = "yes";
    waiting = setTimeout(() => {
      work();
      delete document.documentElement.dataset.pending;
    }, 30);
  }

  function chooseJoint(k) {
    state.joint = Math.min(Math.max(Math.trunc(k) || 0, 0), known.joints.length - 1);
    chooseSet(0);
    const directions = element("direction");
    directions.replaceChildren(...joint().directions.map((d) => new Option(sign(d), d)));
    state.direction = joint().directions[0];
    directions.value = state.direction;
    const sets = element("set");
    sets.replaceChildren(...joint().sets.map((one, at) => new Option(one.label, String(at))));
    element("joint").value = String(state.joint);
    element("simulated").hidden = !joint().simulated;
    for (const id of ["to-truth", "true-key"]) element(id).hidden = !comparable();
    for (const name of settings.parameters) element(`parameter-${name}`).hidden = !sliders().includes(name);
    const { COEFFICIENTS, SHAPE } = bristle.laws[joint().law];
    text("refit", `Refit ${listed(COEFFICIENTS)} at this ${listed(SHAPE)}`);
    samples.get("profile.now").lastChild.textContent = `${listed(COEFFICIENTS)} refitted here`;
    text("friction-law", joint().law_title);
    element("warnings").replaceChildren(...joint().warnings.map((words) => made("li", words)));
    element("warnings").hidden = !joint().warnings.length;
    text("shown-joint", joint().name);
    document.title = `${joint().name}: the friction model in the hand`;
    const [only, ...others] = joint().directions;
    text("one-way", others.length || only === "both" ? "" : `Only direction ${sign(only)} is known: motions both ways have its values in either.`);
    for (const view of Object.values(views)) if (view.joint) view.joint();
  }

  function chooseSet(k) {
    state.set = Math.min(Math.max(Math.trunc(k) || 0, 0), joint().sets.length - 1);
    state.values = valuesOf(set());
    element("set").value = String(state.set);
  }

  function chooseView(name, focus) {
    state.view = Object.hasOwn(views, name) ? name : "friction";
    for (const key of Object.keys(views)) {
      const tab = element(`tab-${key}`), on = key === state.view;
      tab.setAttribute("aria-selected", String(on));
      tab.tabIndex = on ? 0 : -1;
      element(`view-${key}`).hidden = !on;
      if (!on && views[key].leave) views[key].leave();
      if (on && focus) tab.focus();
    }
    changed();
  }

  // What a view asks of its user: numbers within their own limits, words among their own.
  const options = () => [...document.querySelectorAll("[data-option]")];
  function option(id) {
    const field = element(id);
    if (field.type === "checkbox") return field.checked;
    if (field.tagName === "SELECT") return field.value;
    const x = field.valueAsNumber;
    const low = field.min === "" ? -Infinity : Number(field.min), high = field.max === "" ? Infinity : Number(field.max);
    return Number.isFinite(x) ? Math.min(Math.max(x, low), high) : Number(field.defaultValue);
  }

  function listen() {
    element("joint").addEventListener("change", (event) => { chooseJoint(Number(event.target.value)); changed(); });
    element("set").addEventListener("change", (event) => { chooseSet(Number(event.target.value)); changed(); });
    element("direction").addEventListener("change", (event) => { state.direction = event.target.value; changed(); });
    element("reset").addEventListener("click", () => { chooseSet(state.set); changed(); say("Back at the identified values."); });
    element("to-truth").addEventListener("click", () => {
      const real = joint().truth;
      for (const [d, p] of Object.entries(state.values)) {
        const own = real[d] || real["+"] || real["-"];
        for (const name of sliders()) if (own[name] !== null) p[name] = own[name];
      }
      changed();
    });
    element("refit").addEventListener("click", refit);
    for (const [name, sample] of samples) sample.addEventListener("click", () => toggle(name));
    for (const name of settings.parameters) {
      const own = (x) => { state.values[state.direction][name] = x; say(""); changed(); };
      element(`slider-${name}`).addEventListener("input", (event) => own(atFraction(name, Number(event.target.value) / POSITIONS)));
      element(`entry-${name}`).addEventListener("change", (event) => {
        own(clamped(name, event.target.valueAsNumber, state.values[state.direction][name]));
        event.target.blur();
      });
    }
    const tabs = Object.keys(views);
    for (const key of tabs) {
      element(`tab-${key}`).addEventListener("click", () => chooseView(key));
      element(`tab-${key}`).addEventListener("keydown", (event) => {
        const at = tabs.indexOf(key), n = tabs.length;
        const to = { ArrowRight: (at + 1) % n, ArrowLeft: (at + n - 1) % n, Home: 0, End: n - 1 }[event.key];
        if (to === undefined) return;
        event.preventDefault();
        chooseView(tabs[to], true);
      });
    }
    for (const field of options()) {
      field.addEventListener(field.type === "number" ? "input" : "change", () => {
        const view = views[field.closest("[role=tabpanel]").id.replace("view-", "")];
        if (view.chosen) view.chosen(field.id);
        changed();
      });
    }
  }

  async function start() {
    element("joint").replaceChildren(...known.joints.map((one, k) => new Option(one.name, String(k))));
    Bokeh.set_log_level("error"); // of figures that are still empty it would warn
    const names = Object.keys(roots);
    const places = Object.fromEntries(names.map((name) => [roots[name], `figure-${name}`]));
    await Bokeh.embed.embed_items({ explorer: model }, [{ docid: "explorer", roots: places, root_ids: Object.values(roots) }]);
    bokeh = Bokeh.documents[0];
    chooseJoint(0);
    views.values.restore(location.hash);
    listen();
    colours();
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => { colours(); changed(); });
    window.addEventListener("hashchange", () => { views.values.restore(location.hash); changed(); });
    if (known.left_out.length) say(`Left out, as nothing is known of their friction over velocity: ${known.left_out.join(", ")}.`);
    chooseView(state.view);
    document.documentElement.dataset.ready = "yes";
  }

  return {
    array, atFraction, bound, changed, chooseJoint, chooseSet, chooseView, clamped, comparable, costOf, effort, element, errorOf, fill, fix,
    frame, fitsOf, fraction, identified, joint, known, label, later, listed, made, named, option, options, pair, row, say, set, settings,
    shown, sign, sliders, start, state, text, titles, truth, unitOf, views,
  };
})();
