// View 2: slow loading up to sliding, and hysteresis loops, over what was measured.
"use strict";
explorer.views.presliding = (() => {
  const { effort, element, fill, identified, joint, label, named, option, pair, shown, state, text, titles, unitOf } = explorer;
  const POINTS = 200, A_CYCLE = 400;
  const CREEP = 1e-9; // of the fastest measured speed: sliding so slowly takes the breakaway torque

  // The torque at which slow loading slides.
  function breakaway(p, d) {
    const sign = d === "-" ? -1 : 1;
    return sign * bristle.steady(new Float64Array([sign * CREEP * joint().speeds[1]]), p)[0];
  }

  function loading(p, d) {
    const level = breakaway(p, d), own = p[d === "-" ? "-" : "+"];
    const T = Float64Array.from({ length: POINTS }, (_, k) => level * (1 - 1e-3 ** (k / (POINTS - 1))));
    return { x: bristle.loading(T, level, own.sigma_0), y: T };
  }

  function drawLoadings() {
    const d = state.direction, of = joint().presliding[d] || (d === "both" && Object.values(joint().presliding)[0]);
    const found = of ? of.loadings : [];
    fill("loadings", { xs: found.map((x) => x.displacement), ys: found.map((x) => x.torque) });
    const edges = (name) => found.flatMap((x) => x[name]);
    fill("edges", { x: edges("edge_displacement"), y: edges("edge_torque"), place: edges("edge_torque").map(() => "") });
    const now = loading(pair(), d), then = loading(identified(), d), level = breakaway(pair(), d);
    fill("loading.now", now);
    fill("loading.identified", then);
    named("level").location = level;
    const samples = found.reduce((sum, x) => sum + x.samples, 0), kept = found.reduce((sum, x) => sum + x.torque.length, 0);
    text("loading-said", `These values slide at ${shown(level)} ${unitOf("torque")} (dashed line). `
      + (found.length ? `${found.length} measured loadings in this direction, ${kept} of ${samples} samples drawn.` : "No loading was measured in this direction."));
    label("loading", `Torque over displacement in slow loading from rest; these values slide at ${shown(level)} ${unitOf("torque")}.`);
  }

  function draw() {
    drawLoadings();
    const p = pair(), amplitude = option("loop-amplitude") * deflection(identified()), rate = option("loop-rate"), cycles = option("loop-cycles");
    const now = bristle.hysteresis(p, amplitude, rate, cycles, A_CYCLE), then = bristle.hysteresis(identified(), amplitude, rate, cycles, A_CYCLE);
    fill("hysteresis.now", { x: now.y, y: now.torque });
    fill("hysteresis.identified", { x: then.y, y: then.torque });
    const loops = joint().loops, drawn = option("loop-measured") ? loops : [];
    fill("loops", { xs: drawn.map((x) => x.displacement), ys: drawn.map((x) => x.torque) });
    const last = now.torque.length - 1 - A_CYCLE;
    let work = 0;
    for (let k = last + 1; k < now.torque.length; k++) work += (now.torque[k] + now.torque[k - 1]) / 2 * (now.y[k] - now.y[k - 1]);
    const speed = 2 * Math.PI * rate * amplitude, slow = speed > joint().speeds[1] ? " This is faster than anything measured: extrapolated." : "";
    text("loop-said", `Amplitude ${shown(amplitude)} ${unitOf("position")}; the last cycle takes ${shown(work)} ${unitOf("torque")}·${unitOf("position")}.${slow} `
      + (loops.length ? `${loops.length} measured ${loops.length === 1 ? "loop" : "loops"}, ${loops.map((x) => `${x.displacement.length} of ${x.samples} samples`).join(", ")}.` : "No closed loop was measured."));
    label("hysteresis", `Torque over displacement of a sine; the last cycle takes ${shown(work)} ${unitOf("torque")}·${unitOf("position")}.`);
  }

  // How far the bristle bends before it slides: the unit of the amplitude.
  function deflection(p) {
    return breakaway(p, "+") / p["+"].sigma_0;
  }

  function drawJoint() {
    titles("loading", `Displacement from rest (${unitOf("position")})`, effort());
    titles("hysteresis", `Displacement (${unitOf("position")})`, effort());
    const loops = joint().loops, field = element("loop-amplitude");
    element("loop-measured").disabled = !loops.length;
    const widest = Math.max(0, ...loops.map((x) => (Math.max(...x.displacement) - Math.min(...x.displacement)) / 2));
    field.value = field.defaultValue = String(widest ? Number((widest / deflection(identified())).toPrecision(2)) : 0.8);
  }

  return { draw, joint: drawJoint };
})();
