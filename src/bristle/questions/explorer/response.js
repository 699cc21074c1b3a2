// View 3: velocity, deflection, torque and error over time, for a sine, a step, or the measured run.
"use strict";
explorer.views.response = (() => {
  const { array, effort, element, fill, identified, joint, label, option, pair, shown, text, titles, unitOf } = explorer;
  const SAMPLES = 2000; // of a simulated motion
  let kept = { joint: -1 };

  // The velocity that is imposed: {t, v, step, starts}.
  function motion() {
    const kind = option("motion"), moving = joint().moving;
    if (kind === "run" && moving) return { t: array(moving.time), v: array(moving.velocity), step: moving.step, starts: moving.starts };
    const duration = option("duration"), step = duration / (SAMPLES - 1), top = option("top-speed") * joint().speeds[1];
    const t = Float64Array.from({ length: SAMPLES }, (_, k) => k * step), w = 2 * Math.PI * option("motion-frequency");
    const v = kind === "step" ? t.map((x) => (x < duration / 10 ? 0 : top)) : t.map((x) => top * Math.sin(w * x));
    return { t, v, step, starts: [0] };
  }

  function left(p) {
    if (kept.joint !== explorer.state.joint) kept = { joint: explorer.state.joint, of: costs.left(joint().moving) };
    return kept.of(p);
  }

  const rms = (x) => Math.sqrt(x.reduce((sum, y) => sum + y * y, 0) / x.length);

  function draw() {
    const p = pair(), chosen = motion(), now = costs.simulated(chosen, p), then = costs.simulated(chosen, identified());
    const run = option("motion") === "run" && joint().moving, t = chosen.t;
    const of = run ? left(p) : null;
    const error = of ? of.error : now.torque.map((T, k) => T - then.torque[k]);
    fill("velocity.now", { x: t, y: chosen.v });
    fill("deflection.now", { x: t, y: now.z });
    fill("deflection.identified", { x: t, y: then.z });
    fill("torque.now", { x: t, y: now.torque });
    fill("torque.identified", { x: t, y: then.torque });
    fill("torque.measured", of ? { x: t, y: of.measured } : { x: [], y: [] });
    fill("error.now", { x: t, y: error });
    let words;
    if (of) {
      const relative = 100 * Math.sqrt(error.reduce((sum, r) => sum + r * r, 0)) / joint().moving.norm;
      element("response-said").dataset.relative = String(relative);
      const whole = joint().moving.relative_error;
      words = `Relative error ${shown(relative)} % (the fit of moving runs: ${whole === null ? "of another part" : `${shown(whole)} %`}), RMS ${shown(rms(error))} ${unitOf("torque")}. `
        + `Drawn are ${t.length} of ${joint().moving.equations} equations of that fit, low-passed and thinned from the log as it had them; `
        + "the measured torque is that of friction, with what the fit finds of inertia and other loads taken off.";
    } else {
      words = `RMS difference to the identified values ${shown(rms(error))} ${unitOf("torque")}, ${shown(100 * rms(error) / rms(then.torque), 3)} % of their torque. `;
      if (Math.abs(option("top-speed")) > 1) words += "Faster than anything measured: extrapolated.";
    }
    text("response-said", words);
    label("torque", `Friction torque over time. ${words}`);
    label("velocity", "Velocity over time.");
    label("deflection", "Deflection of the bristle over time.");
    label("error", of ? "Measured less modelled torque over time." : "Torque of these values less that of the identified ones over time.");
    const T = `(${unitOf("torque")})`;
    titles("velocity", "", `Velocity (${unitOf("velocity")})`);
    titles("deflection", "", `z (${unitOf("position")})`);
    titles("torque", "", effort());
    titles("error", "Time (s)", of ? `Error ${T}` : `Difference ${T}`);
  }

  function drawJoint() {
    const has = Boolean(joint().moving), field = element("motion");
    for (const one of field.options) if (one.value === "run") one.disabled = !has;
    if (!has && field.value === "run") field.value = "sine";
    chosen();
  }

  function chosen() {
    const kind = option("motion");
    element("motion-frequency").disabled = kind !== "sine";
    for (const id of ["top-speed", "duration"]) element(id).disabled = kind === "run";
  }

  return { draw, joint: drawJoint, chosen };
})();
