// What values cost on the measured data, and the map of that over two parameters. Nothing here knows the page: a worker
// is made of this text with that of `bristle`, and answers what it is sent.
const costs = (() => {
  "use strict";
  const WORKER = typeof importScripts === "function";
  const SLICE = WORKER ? 50 : 12; // ms between two looks at what else is asked
  const array = (x) => Float64Array.from(x);
  let latest = null;

  // Pair -> the cost of fits of constant velocities: the sum of each fit's own.
  function ofPoints(fits) {
    const own = fits.map((fit) => [array(fit.velocity), array(fit.torque)]);
    return (p) => own.reduce((sum, [v, T]) => sum + bristle.cost(v, T, p), 0);
  }

  // The torque of a bristle, each run from one of its own.
  function simulated({ v, step, starts }, p) {
    const z = new Float64Array(v.length), torque = new Float64Array(v.length);
    starts.forEach((start, k) => {
      const rolled = bristle.rollout(v.subarray(start, starts[k + 1] ?? v.length), step, p);
      z.set(rolled.z, start);
      torque.set(rolled.torque, start);
    });
    return { z, torque };
  }

  // Pair -> what the fit of moving runs leaves with other values: its residuals, and the change of the simulated torque.
  function left(moving) {
    const run = { v: array(moving.velocity), step: moving.step, starts: moving.starts };
    const then = simulated(run, moving.pair).torque, measured = array(moving.residuals).map((r, k) => r + then[k]);
    return (p) => {
      const torque = simulated(run, p).torque;
      return { measured, error: measured.map((T, k) => T - torque[k]) };
    };
  }

  function ofRun(moving) {
    const of = left(moving);
    return (p) => of(p).error.reduce((sum, r) => sum + r * r, 0);
  }

  // The least cost, and what its change is counted in: up to the 95 % threshold of one parameter, (3.84 / (n - p)) of the
  // least where none is known.
  function scale({ fits, moving, identified }, cost) {
    if (fits && fits.every((fit) => fit.threshold !== null)) {
      return { least: fits.reduce((sum, fit) => sum + fit.least, 0), by: Math.max(...fits.map((fit) => fit.threshold - fit.least)) };
    }
    const least = cost(identified), n = (fits || [moving]).reduce((sum, one) => sum + one.velocity.length, 0);
    const { COEFFICIENTS, SHAPE } = bristle.laws[identified.law], unknowns = COEFFICIENTS.length + SHAPE.length;
    return { least, by: 3.84 * least / Math.max(n - unknowns, 1) };
  }

  // Answers {job, part} now and then, at the end {job, cells}: n x n, each {x, y, change, active}. What is asked later
  // ends it, null too. Asked are a job's number, n, the `names` of two parameters, the `ends` of either, the `pair` that
  // the others are of, the `directions` that take the two, the identified pair, and either fits or the moving run.
  async function map(asked, answer) {
    latest = asked;
    const others = () => new Promise((resume) => setTimeout(resume));
    await others();
    if (latest !== asked || !asked) return;
    const { job, n, names: [a, b], ends: [[x0, x1], [y0, y1]], pair, directions, fits, moving } = asked;
    const cost = fits ? ofPoints(fits) : ofRun(moving), { least, by } = scale(asked, cost), cells = [];
    const width = (x1 - x0) / n, height = (y1 - y0) / n;
    let since = performance.now();
    for (let k = 0; k < n * n; k++) {
      const x = x0 + (k % n + 0.5) * width, y = y0 + (Math.floor(k / n) + 0.5) * height;
      const own = { ...pair[directions[0]], [a]: x, [b]: y }, p = { ...pair };
      for (const d of directions) p[d] = own;
      cells.push({ x, y, change: (cost(p) - least) / by, active: !bristle.isPassive(own, pair.law) });
      if (performance.now() - since > SLICE) {
        answer({ job, part: k / (n * n) });
        await others();
        if (latest !== asked) return;
        since = performance.now();
      }
    }
    answer({ job, cells });
  }

  if (WORKER) onmessage = ({ data }) => map(data, postMessage);
  return { left, map, ofPoints, ofRun, simulated };
})();
