// The loops of the explorer. No equation stands here: the functions that are called in lower camel case and are not
// defined below are printed by engine.py from bristle's own CasADi functions. Everything is pure; nothing here knows a
// page. Arrays are Float64Array (anything with a length may come in). SI units: rad, s, N*m (m and N where a joint
// slides).
//
// A parameter set p is {alpha_0, alpha_1, alpha_2, v_s, sigma_0, sigma_1}, positive numbers in both directions; a pair
// is {"+": p, "-": p}. A pair of two equal sets is one set, as `Lugre` in Python.
//
// bristle.steady(v, pair)                -> T: the steady torque (9) at velocities v, of the set by the sign of v
// bristle.steadySlopes(v, pair)          -> {alpha_0, alpha_1, alpha_2, v_s}: its derivatives by that set
// bristle.refit(v, T, weight, v_s)       -> {alpha_0, alpha_1, alpha_2, cost}: >= 0, least squares (11)-(13) at that v_s
// bristle.cost(v, T, weight, pair)       -> sum of the squares of weight * (T - steady torque)
// bristle.rollout(v, dt, pair, z0)       -> {z, torque} along a velocity that is linear between its samples; dt is a
//     number or an array (n - 1); without z0 the bristle is steady at first
// bristle.loading(T, g0, sigma_0)        -> displacement in slow loading from rest to torques T; NaN where abs(T) >= g0:
//     the joint slides
// bristle.hysteresis(pair, amplitude, rate, cycles, points) -> {y, torque}: y = amplitude sin(2 pi rate t), rate in Hz,
//     from an unbent bristle, so many points a cycle

const FIELDS = ["alpha_0", "alpha_1", "alpha_2", "v_s", "sigma_0", "sigma_1"];

// The twelve numbers of a pair, the positive set first.
function numbers(pair) {
  const q = new Float64Array(12);
  FIELDS.forEach((name, k) => {
    q[k] = pair["+"][name];
    q[6 + k] = pair["-"][name];
  });
  return q;
}

function steady(v, pair) {
  const q = numbers(pair), T = new Float64Array(v.length);
  for (let k = 0; k < T.length; k++) T[k] = steadyTorque(v[k], q);
  return T;
}

function steadySlopes(v, pair) {
  const q = numbers(pair), out = new Float64Array(4), names = FIELDS.slice(0, 4);
  const slopes = names.map(() => new Float64Array(v.length));
  for (let k = 0; k < v.length; k++) {
    steadyJacobian(v[k], q, out);
    for (let i = 0; i < 4; i++) slopes[i][k] = out[i];
  }
  return Object.fromEntries(names.map((name, i) => [name, slopes[i]]));
}

function cost(v, T, weight, pair) {
  const q = numbers(pair);
  let sum = 0;
  for (let k = 0; k < v.length; k++) {
    const r = (weight ? weight[k] : 1) * (T[k] - steadyTorque(v[k], q));
    sum += r * r;
  }
  return sum;
}

function dot(a, b) {
  let sum = 0;
  for (let k = 0; k < a.length; k++) sum += a[k] * b[k];
  return sum;
}

const INDEPENDENT = 1e-10; // a column counts of which this much, relative, is left by those before it

// Least squares of b on these columns, by Gram-Schmidt done twice: {x, cost}; null where a column depends on others.
function solve(columns, b) {
  const m = columns.length, q = [], r = columns.map(() => new Float64Array(m)), rest = Float64Array.from(b);
  const x = new Float64Array(m), y = new Float64Array(m);
  for (let j = 0; j < m; j++) {
    const own = Float64Array.from(columns[j]), before = Math.sqrt(dot(own, own));
    for (let pass = 0; pass < 2; pass++) {
      for (let i = 0; i < j; i++) {
        const part = dot(q[i], own);
        r[i][j] += part;
        for (let k = 0; k < own.length; k++) own[k] -= part * q[i][k];
      }
    }
    r[j][j] = Math.sqrt(dot(own, own));
    if (!(r[j][j] > INDEPENDENT * before)) return null;
    for (let k = 0; k < own.length; k++) own[k] /= r[j][j];
    q.push(own);
    for (let pass = 0; pass < 2; pass++) {
      const part = dot(own, rest);
      y[j] += part;
      for (let k = 0; k < rest.length; k++) rest[k] -= part * own[k];
    }
  }
  for (let j = m - 1; j >= 0; j--) {
    x[j] = y[j];
    for (let i = j + 1; i < m; i++) x[j] -= r[j][i] * x[i];
    x[j] /= r[j][j];
  }
  return { x, cost: dot(rest, rest) };
}

// Of three unknowns that may not be negative, the least cost stands where some are zero and the others free: all eight
// choices are tried.
function refit(v, T, weight, v_s) {
  const n = v.length, out = new Float64Array(3), columns = [0, 1, 2].map(() => new Float64Array(n));
  const b = new Float64Array(n);
  for (let k = 0; k < n; k++) {
    const w = weight ? weight[k] : 1;
    steadyColumns(v[k], v_s, out);
    for (let j = 0; j < 3; j++) columns[j][k] = w * out[j];
    b[k] = w * T[k];
  }
  let best = { alpha_0: 0, alpha_1: 0, alpha_2: 0, cost: Infinity };
  for (let choice = 7; choice >= 0; choice--) {
    const free = [0, 1, 2].filter((j) => choice & (1 << j));
    const found = solve(free.map((j) => columns[j]), b);
    if (found && found.cost < best.cost && found.x.every((x) => x >= 0)) {
      best = { alpha_0: 0, alpha_1: 0, alpha_2: 0, cost: found.cost };
      free.forEach((j, i) => { best[FIELDS[j]] = found.x[i]; });
    }
  }
  return best;
}

// The bristle of one pair, stepped from sample to sample as model/rollout.py and model/time_refinement.py have it.
function bristleOf(q) {
  const v_s = Math.min(q[3], q[9]), fine = FINE * v_s, near = NEAR * v_s, ab = new Float64Array(2);
  let alike = true;
  for (let k = 0; k < 6; k++) alike = alike && q[k] === q[6 + k];

  // Over a step in which v keeps its sign; where z changes its own, sigma_0 changes, and the step is cut there.
  function piece(z, v0, v1, h) {
    const ahead = Math.sign(v0 + v1), side = z === 0 ? ahead : Math.sign(z);
    bristleStep(side, v0, v1, h, q, ab);
    const next = ab[0] * z + ab[1];
    if (alike || !(side * next < 0)) return next;
    const forgotten = Math.min(Math.max(1 - ab[0], 1e-9), 1 - 1e-15);
    const way = Math.min(Math.log1p(Math.abs(z / ab[1]) * forgotten) / -Math.log1p(-forgotten), 1);
    const slow = Math.abs(v0), fast = Math.abs(v1);
    const part = (way * (slow + fast)) / (slow + Math.sqrt(slow * slow + (fast * fast - slow * slow) * way));
    const middle = v0 + (v1 - v0) * part;
    bristleStep(side, v0, middle, h * part, q, ab);
    const there = ab[0] * z + ab[1];
    bristleStep(ahead, middle, v1, h * (1 - part), q, ab);
    return ab[0] * there + ab[1];
  }

  return (z, v0, v1, h) => {
    const change = Math.abs(v1 - v0), crosses = v0 * v1 < 0;
    const slowest = crosses ? 0 : Math.min(Math.abs(v0), Math.abs(v1));
    const count = change > fine && slowest < near ? Math.min(Math.ceil(change / fine), MOST) : 1;
    if (count === 1 && !crosses) return piece(z, v0, v1, h);
    let zero = crosses ? v0 / (v0 - v1) : 2, at = 0, from = v0;
    for (let i = 1; i <= count; i++) {
      const part = i / count;
      if (zero < part) {
        const to = v0 + (v1 - v0) * zero;
        z = piece(z, from, to, h * (zero - at));
        [at, from, zero] = [zero, to, 2];
      }
      const to = i === count ? v1 : v0 + (v1 - v0) * part;
      z = piece(z, from, to, h * (part - at));
      [at, from] = [part, to];
    }
    return z;
  };
}

function rollout(v, dt, pair, z0) {
  const n = v.length, q = numbers(pair), step = bristleOf(q), varies = typeof dt !== "number";
  const z = new Float64Array(n), torque = new Float64Array(n);
  let now = z0 ?? (n ? steadyDeflection(v[0], q) : 0);
  for (let k = 0; k < n; k++) {
    if (k) now = step(now, v[k - 1], v[k], varies ? dt[k - 1] : dt);
    z[k] = now;
    torque[k] = frictionTorque(now, v[k], q);
  }
  return { z, torque };
}

function loading(T, g0, sigma_0) {
  const y = new Float64Array(T.length);
  for (let k = 0; k < y.length; k++) {
    const size = Math.abs(T[k]);
    y[k] = size < g0 ? Math.sign(T[k]) * loadingDisplacement(size, g0, sigma_0) : NaN;
  }
  return y;
}

function hysteresis(pair, amplitude, rate, cycles, points) {
  const n = Math.round(cycles * points) + 1, dt = 1 / (rate * points), out = new Float64Array(3);
  const y = new Float64Array(n), v = new Float64Array(n);
  for (let k = 0; k < n; k++) {
    sine(k * dt, amplitude, rate, out);
    [y[k], v[k]] = out;
  }
  return { y, torque: rollout(v, dt, pair, 0).torque };
}

function closedLoop(options) {
  throw new Error("not yet");
}

return { steady, steadySlopes, refit, cost, rollout, loading, hysteresis, closedLoop };
