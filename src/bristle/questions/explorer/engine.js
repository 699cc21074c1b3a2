// The loops of the explorer. No equation stands here: the functions that are called in lower camel case and are not
// defined below are printed by engine.py from bristle's own CasADi functions. Everything is pure; nothing here knows a
// page. Arrays are Float64Array (anything with a length may come in). SI units: rad, s, N*m (m and N where a joint
// slides).
//
// A parameter set p is {alpha_0, alpha_1, alpha_2, v_s, sigma_0, sigma_1}, positive numbers in both directions, and what
// its friction law has beside them; a pair is {law, "+": p, "-": p}, law the name of one of bristle.laws. A pair of two
// equal sets is one set, as `Lugre` in Python.
//
// bristle.laws                           -> by name what a law is: FIELDS, its parameters; SHAPE, those of its peak that
//     are not linear; COEFFICIENTS, the linear ones, and what each may be at LEAST, 0 or -Infinity
// bristle.steady(v, pair)                -> T: the steady torque (9) at velocities v, of the set by the sign of v
// bristle.refit(v, T, law, p)            -> {alpha_0, alpha_1, alpha_2, ..., cost}: least squares (11)-(13), >= 0
//     but for those with a sign, at the v_s of p and what else shapes the peak
// bristle.cost(v, T, pair)               -> sum of the squares of T - steady torque
// bristle.isPassive(p, law)              -> whether LuGre dissipates with this set, whatever the motion
// bristle.heldFrom(p, law)               -> the speed beyond which viscous friction is held, as nobody has seen it fall
//     further: Infinity but where a coefficient is negative
// bristle.rollout(v, dt, pair, z0)       -> {z, torque} along a velocity that is linear between its samples, dt s apart;
//     without z0 the bristle is steady at first
// bristle.loading(T, g0, sigma_0)        -> displacement in slow loading from rest to torques T; NaN where abs(T) >= g0:
//     the joint slides
// bristle.hysteresis(pair, amplitude, rate, cycles, points) -> {y, torque}: y = amplitude sin(2 pi rate t), rate in Hz,
//     from an unbent bristle, so many points a cycle
// bristle.closedLoop(options)            -> {time, reference, position, velocity, deflection, error, torque, friction,
//     compensation, factors, diverged, rms}: the joint in its loop, from rest
//   options are those of `engine.loop_options`, any number of which may be changed: law (a key of laws: none, fixed, or
//     one that adapts), gamma (by law), start (the model begins with these shares of its parameters), amplitude,
//     frequency (Hz), gains, period, duration, settle (s), plant and model (pairs), J.
//   error is reference - position, rms that of it from settle on; factors has, by parameter, share of the model's own
//     value at each period. A loop that diverges is cut: all arrays end there, diverged is the time (else null), rms null.

// The numbers of a pair, twelve of the paper's law, the positive set first.
function numbers(pair) {
  const { FIELDS } = LAWS[pair.law];
  return Float64Array.from(["+", "-"].flatMap((d) => FIELDS.map((name) => pair[d][name])));
}

function isPassive(p, law) {
  return LAWS[law].passive(LAWS[law].FIELDS.map((name) => p[name])) === 1;
}

function heldFrom(p, law) {
  return LAWS[law].COEFFICIENTS.slice(3).some((name) => p[name] < 0) ? p[FASTEST] : Infinity;
}

function steady(v, pair) {
  const { steadyTorque } = LAWS[pair.law], q = numbers(pair), T = new Float64Array(v.length);
  for (let k = 0; k < T.length; k++) T[k] = steadyTorque(v[k], q);
  return T;
}

function cost(v, T, pair) {
  const { steadyTorque } = LAWS[pair.law], q = numbers(pair);
  let sum = 0;
  for (let k = 0; k < v.length; k++) {
    const r = T[k] - steadyTorque(v[k], q);
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

// Of unknowns of which some may not be negative, the least cost stands where some of these are zero and the others free:
// where all free ones are not good, every other choice is tried.
function refit(v, T, law, p) {
  const { COEFFICIENTS, LEAST, SHAPE, steadyColumns } = LAWS[law], n = v.length, shape = SHAPE.map((name) => p[name]);
  const out = new Float64Array(LEAST.length), columns = LEAST.map(() => new Float64Array(n));
  for (let k = 0; k < n; k++) {
    steadyColumns(v[k], ...shape, out);
    for (let j = 0; j < out.length; j++) columns[j][k] = out[j];
  }
  const all = 2 ** LEAST.length - 1, zero = Object.fromEntries(COEFFICIENTS.map((name) => [name, 0]));
  let best = { ...zero, cost: Infinity };
  for (let choice = all; choice >= 0; choice--) {
    const free = [...LEAST.keys()].filter((j) => choice & (1 << j));
    if (!LEAST.every((least, j) => least === 0 || free.includes(j))) continue; // what has a sign is always free
    const found = solve(free.map((j) => columns[j]), T);
    if (found && found.cost < best.cost && found.x.every((x, i) => x >= LEAST[free[i]])) {
      best = { ...zero, cost: found.cost };
      free.forEach((j, i) => { best[COEFFICIENTS[j]] = found.x[i]; });
      if (choice === all) break;
    }
  }
  return best;
}

// The bristle of one pair, stepped from sample to sample as model/rollout.py and model/time_refinement.py have it.
function bristleOf(pair) {
  const { FIELDS, bristleStep } = LAWS[pair.law], { "+": positive, "-": negative } = pair, q = numbers(pair);
  const v_s = Math.min(positive.v_s, negative.v_s), fine = FINE * v_s, near = NEAR * v_s, ab = new Float64Array(2);
  const alike = FIELDS.every((name) => positive[name] === negative[name]);

  // Over a step in which v keeps its sign; where z changes its own, sigma_0 changes, and the step is cut there. A step
  // so coarse that z stays on its side once it is cut remains whole, as the passes of Python's scan leave it.
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
    const last = ab[0] * there + ab[1];
    return side * last < 0 ? last : next;
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
  const { steadyDeflection, frictionTorque } = LAWS[pair.law];
  const n = v.length, q = numbers(pair), step = bristleOf(pair);
  const z = new Float64Array(n), torque = new Float64Array(n);
  let now = z0 ?? (n ? steadyDeflection(v[0], q) : 0);
  for (let k = 0; k < n; k++) {
    if (k) now = step(now, v[k - 1], v[k], dt);
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

// A run in the closed loop, cut where it diverges, of a law of options.laws from these shares of the model's parameters.
function run(options, law, start) {
  const { rest, period, size } = LAWS[options.model.law].LOOPS[options.laws[law]], adapts = law !== "none" && law !== "fixed";
  const { FIELDS } = LAWS[options.model.law], plant = numbers(options.plant);
  const begun = numbers(options.model).map((x, k) => x * (start[FIELDS[k % FIELDS.length]] ?? 1));
  const names = adapts ? options.parameters : [];
  const gamma = adapts ? options.gamma[law] : [];
  const settings = Float64Array.from(SETTINGS.flatMap((name) => (name === "gamma" ? gamma : options[name])));
  const gains = GAINS.map((name) => options.gains[name]), h = options.period;
  const n = Math.round(options.duration / h) + 1, at = (k, out) => sine(k * h, options.amplitude, options.frequency, out);
  const logs = Object.fromEntries(["time", "reference", ...LOGGED].map((name) => [name, new Float64Array(n)]));
  const theta = names.map(() => new Float64Array(n)), rows = LOGGED.map((name) => logs[name]);
  let memory = new Float64Array(size + rows.length + names.length), out = new Float64Array(memory.length);
  const r = new Float64Array(3), most = limit(options, n, at, [plant, begun], FIELDS.length);
  at(0, r);
  rest(r[0], settings, memory);
  let k = 0;
  for (; k < n; k++) {
    at(k, r);
    period(memory, r[0], r[1], r[2], plant, begun, options.J, gains, settings, h, out);
    let sum = 0;
    for (let i = 0; i < rows.length; i++) sum += out[size + i];
    if (!(Math.abs(r[0] - out[size]) <= most && Number.isFinite(sum))) break;
    logs.time[k] = h * k;
    logs.reference[k] = r[0];
    for (let i = 0; i < rows.length; i++) rows[i][k] = out[size + i];
    for (let i = 0; i < names.length; i++) theta[i][k] = (start[names[i]] ?? 1) * out[size + rows.length + i];
    [memory, out] = [out, memory];
  }
  for (const name in logs) logs[name] = logs[name].subarray(0, k);
  const error = logs.reference.map((y, i) => y - logs.position[i]);
  const factors = Object.fromEntries(names.map((name, i) => [name, theta[i].subarray(0, k)]));
  return { ...logs, error, factors, diverged: k < n ? h * k : null };
}

// The position error beyond which a loop diverges: ten times what is to be followed, or than what its friction makes.
function limit(options, n, at, pairs, count) {
  const r = new Float64Array(3);
  let most = Math.max(...pairs.flatMap((q) => [q[0] + q[1], q[count] + q[count + 1]])) / options.gains.K_p;
  for (let k = 0; k < n; k++) {
    at(k, r);
    most = Math.max(most, Math.abs(r[0]));
  }
  return 10 * most;
}

// Root mean square of the error since a time; null where the loop diverges, or ends before.
function rms(trajectory, since) {
  let sum = 0, count = 0;
  trajectory.time.forEach((t, k) => {
    if (t >= since) {
      sum += trajectory.error[k] ** 2;
      count += 1;
    }
  });
  return trajectory.diverged === null && count ? Math.sqrt(sum / count) : null;
}

function closedLoop(options) {
  const own = run(options, options.law, options.start);
  return { ...own, rms: rms(own, options.settle) };
}

return { laws: LAWS, steady, refit, cost, isPassive, heldFrom, rollout, loading, hysteresis, closedLoop };
