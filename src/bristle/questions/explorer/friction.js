// View 1: the friction curve over what was measured, its residuals, and the cost of each fit beside its 95 % threshold.
"use strict";
explorer.views.friction = (() => {
  const { array, costOf, errorOf, effort, fill, fix, frame, identified, joint, label, later, made, named, pair, row, shown, sign, state, text, titles, truth, unitOf } = explorer;
  const POINTS = 240; // of a curve, in each direction
  const AROUND = 1.3; // times the fastest measured speed, to which curves go
  let shownSet = ""; // of which the identified curve is drawn

  function speeds(sign) {
    const [slowest, fastest] = joint().speeds, low = slowest / 10, high = AROUND * fastest;
    return Float64Array.from({ length: POINTS }, (_, k) => sign * low * (high / low) ** (k / (POINTS - 1)));
  }

  // Columns of a curve: over velocity, and magnitudes over speed.
  function columns(v, T, more = {}) {
    const sign = v.map(Math.sign);
    return { x: v, y: T, speed: v.map(Math.abs), size: T.map((t, k) => sign[k] * t), ...more };
  }

  // The part of a curve at some of its points, by their place in it.
  const part = (whole, keep) => Object.fromEntries(Object.entries(whole).map(([key, x]) => [key, x.filter((_, k) => keep(k))]));

  function curve(p, sign) {
    const v = speeds(sign);
    return columns(v, bristle.steady(v, p));
  }

  const NONE = { x: [], y: [], speed: [], size: [] };
  const known = (d) => joint().directions.includes(d) || joint().directions.includes("both");

  // The known directions of a set, with a gap between them.
  function both(p) {
    const parts = p ? [...(known("-") ? [curve(p, -1)] : []), ...(known("+") ? [curve(p, 1)] : [])] : [];
    if (parts.length < 2) return parts[0] || NONE;
    return Object.fromEntries(Object.keys(parts[0]).map((key) => [key, Float64Array.from([...parts[0][key], NaN, ...parts[1][key]])]));
  }

  function points(rows, more) {
    return columns(array(rows.map((row) => row.velocity)), array(rows.map((row) => row.torque)), { place: rows.map((row) => row.place), ...more });
  }

  function measured() {
    const rows = joint().static.flatMap((fit) => fit.velocity.map((velocity, k) => ({
      velocity,
      torque: fit.torque[k],
      error: fit.standard_error ? fit.standard_error[k] : null,
      sticks: Boolean(fit.stick_slip[k]),
      place: fit.place[k] || "moving run",
    })));
    for (const [name, sign] of [["+", 1], ["-", -1]]) {
      const own = rows.filter((row) => row.velocity * sign > 0);
      fill(`points${name}`, points(own));
      const bars = own.filter((row) => row.error !== null).map((row) => ({ ...row, half: 1.96 * row.error }));
      const side = (by) => array(bars.map((row) => row.torque + by * row.half));
      const size = (by) => array(bars.map((row) => sign * row.torque + by * row.half));
      fill(`bars${name}`, points(bars, { low: side(-1), high: side(1), size_low: size(-1), size_high: size(1) }));
    }
    fill("sticking", points(rows.filter((row) => row.sticks)));
    fill("held", points(joint().other_points));
    fill("strays", points(joint().static.flatMap((fit) => fit.strays)));
  }

  function hatched() {
    const [slowest, fastest] = joint().speeds, far = 2 * AROUND * fastest;
    const regions = { beyond: [fastest, far], before: [-far, -fastest], faster: [fastest, far], slower: [slowest / 20, slowest] };
    for (const [name, [left, right]] of Object.entries(regions)) named(name).setv({ left, right, visible: true });
  }

  // A row of the table of costs, told to a reader: one for each fit.
  function costs() {
    const p = pair();
    const rows = joint().static.map((fit) => {
      const cost = costOf(fit, p), error = errorOf(fit, p), has = fit.threshold !== null;
      const over = has ? (cost - fit.least) / (fit.threshold - fit.least) : NaN;
      const verdict = !has ? "no threshold" : over <= 1 ? "within" : "beyond";
      const line = row(sign(fit.direction), [
        shown(cost, 5), has ? shown(fit.least, 5) : "–", has ? shown(fit.threshold, 5) : "–", `${shown(error)} %`,
        fit.relative_error === null ? "–" : `${shown(fit.relative_error)} %`, "",
      ]);
      Object.assign(line.dataset, { direction: fit.direction, cost, error });
      const value = Number.isFinite(over) ? Math.min(Math.max(over, 0), 2) : 0, ariaLabel = `change of cost, in changes up to the 95 % threshold: ${shown(over, 3)}`;
      const meter = made("meter", "", { min: 0, max: 2, low: 1, high: 1.0001, optimum: 0, value, ariaLabel });
      line.lastChild.append(meter, ` ${verdict}${has ? ` (${over < 5e-4 ? "0" : shown(over, 3)})` : ""}`);
      return line;
    });
    explorer.element("costs").replaceChildren(...rows);
    return rows.map((line) => `${line.dataset.direction}: cost ${shown(Number(line.dataset.cost))}, ${line.lastChild.lastChild.textContent.trim()} the 95 % threshold`);
  }

  function residuals() {
    const p = pair(), every = [0];
    for (const [name, sign] of [["+", 1], ["-", -1]]) {
      const v = [], left = [];
      for (const fit of joint().static) {
        const T = bristle.steady(array(fit.velocity), p);
        fit.velocity.forEach((velocity, k) => {
          if (velocity * sign > 0) {
            v.push(velocity);
            left.push(fit.torque[k] - T[k]);
          }
        });
      }
      every.push(...left);
      fill(`residuals${name}`, { x: v, y: left, place: v.map(() => "") });
    }
    frame("residuals", "y_range", every);
  }

  function draw() {
    const p = pair();
    const plus = known("+") ? curve(p, 1) : NONE, minus = known("-") ? curve(p, -1) : NONE;
    const ends = [["+", plus], ["-", minus]].map(([d, whole]) => {
      const { speed } = whole, from = bristle.heldFrom(p[d], p.law);
      fill(`now${d}`, part(whole, (k) => speed[k] <= from));
      fill(`now${d}.held`, part(whole, (k) => (speed[k + 1] ?? Infinity) > from));
      return speed.length && from < Infinity ? `${shown(from)} ${unitOf("velocity")} (${sign(d)})` : "";
    }).filter(Boolean);
    const held = ends.length ? `Dashed beyond ${ends.join(" and ")}: viscous friction bends down with speed. Faster than anything measured it is held as large as it is there, and was not measured.` : "";
    text("held-said", held);
    const torques = joint().static.flatMap((fit) => fit.torque);
    frame("curve", "y_range", [...torques, ...plus.y, ...minus.y]);
    frame("log", "y_range", [...torques.map(Math.abs), ...plus.size, ...minus.size]);
    later(residuals);
    const said = costs().join("; ") || "no fit of constant velocities";
    label("curve", `Friction over velocity: measured points and the curve of these values. ${said}${held && `. ${held}`}`);
    label("log", `The same as magnitudes over the logarithm of speed. ${said}`);
    label("residuals", "Measured less modelled friction at each fitted point, over velocity.");
    const of = `${state.joint} ${state.set}`;
    if (shownSet !== of) fill("identified", both(identified()));
    shownSet = of;
  }

  // Of a joint that was chosen: what does not change with the sliders.
  function drawJoint() {
    const v = `Velocity (${unitOf("velocity")})`;
    titles("curve", v, effort());
    titles("log", `Speed (${unitOf("velocity")})`, `Magnitude of ${joint().effort} (${unitOf("torque")})`);
    titles("residuals", v, `Residual (${unitOf("torque")})`);
    measured();
    hatched();
    const [slowest, fastest] = joint().speeds, top = 1.1 * AROUND * fastest;
    const [left, right] = [known("-") ? -top : -top / 20, known("+") ? top : top / 20];
    fix("curve", "x_range", left, right);
    fix("residuals", "x_range", left, right);
    fix("log", "x_range", slowest / 12, top);
    fill("truth", both(truth()));
    explorer.element("costs-caption").lastChild.textContent = `(${unitOf("torque")})²`;
  }

  return { draw, joint: drawJoint };
})();
