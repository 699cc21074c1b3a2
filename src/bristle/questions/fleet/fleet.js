// What the page knows of a fleet, how its columns are unpacked, and how numbers are written: as bristle's own tables have them.
// Texts of users are set as text only.
"use strict";
const fleet = (() => {
  const known = JSON.parse(document.getElementById("data").textContent);
  const MISSING = "–", LEAST = 1e-30;
  const KINDS = { f4: Float32Array, f8: Float64Array, u1: Uint8Array, u2: Uint16Array, u4: Uint32Array };
  const element = (id) => document.getElementById(id);

  // ---- packed columns

  function numbers({ as, data }) {
    const bytes = Uint8Array.from(atob(data), (c) => c.charCodeAt(0));
    return new KINDS[as](bytes.buffer);
  }

  // A column: the k-th number, or text.
  function column(packed) {
    const own = numbers(packed), { words } = packed;
    const at = words ? (k) => words[own[k]] : (k) => own[k];
    at.count = own.length;
    return at;
  }

  const columns = (table) => Object.fromEntries(Object.entries(table).map(([name, one]) => [name, column(one)]));

  // ---- numbers in print

  function number(x, digits = 4) {
    if (x === null || x === undefined || Number.isNaN(x)) return MISSING;
    if (!Number.isFinite(x)) return x > 0 ? "∞" : "-∞";
    if (x === 0) return "0";
    const [mantissa, power] = x.toExponential(digits - 1).split("e");
    if (Number(power) >= -4 && Number(power) < digits) return String(Number(x.toPrecision(digits)));
    const size = Math.abs(Number(power));
    return `${String(Number(mantissa))}e${Number(power) < 0 ? "-" : "+"}${size < 10 ? "0" : ""}${size}`;
  }

  const places = (width) => Math.min(Math.max(1 - Math.floor(Math.log10(width / 4)), 0), 12);

  // A change with its interval: +15.2 [12.1, 18.3].
  function change(value, low, high) {
    if (!Number.isFinite(value)) return MISSING;
    const width = high - low, sign = value > 0 ? "+" : "";
    if (!(Number.isFinite(width) && width > 0 && Math.max(Math.abs(low), Math.abs(high)) < 1e6)) return sign + number(value, 3);
    const n = places(width);
    return `${sign}${value.toFixed(n)} [${low.toFixed(n)}, ${high.toFixed(n)}]`;
  }

  // Value ± standard error, both to the second digit of the error.
  function measured(value, error) {
    if (!Number.isFinite(value) || !Number.isFinite(error) || !(error > 0)) return number(value);
    const rounded = Number(error.toExponential(1)), n = 1 - Math.floor(Math.log10(rounded));
    const size = Math.max(Math.floor(Math.log10(Math.max(Math.abs(value), rounded))), -300);
    const fixed = (x, digits) => x.toFixed(Math.min(Math.max(digits, 0), 100));
    if (size >= -5 && size < 6) return `${fixed(n < 0 ? Math.round(value * 10 ** n) / 10 ** n : value, n)} ± ${fixed(rounded, n)}`;
    const scale = 10 ** size, digits = n + size, power = `${size < 0 ? "-" : "+"}${String(Math.abs(size)).padStart(2, "0")}`;
    return `(${fixed(value / scale, digits)} ± ${fixed(rounded / scale, digits)})e${power}`;
  }

  const probability = (p) => (Number.isNaN(p) ? MISSING : p < LEAST ? `< ${number(LEAST)}` : number(p, 2));
  const signed = (x, digits = 3) => (x > 0 ? "+" : "") + number(x, digits);
  const day = (ms) => (Number.isFinite(ms) ? new Date(ms).toISOString().slice(0, 10) : MISSING);
  const counted = (n, thing) => `${n} ${thing}${n === 1 ? "" : "s"}`;
  const withUnit = (text, unit) => (unit ? `${text} ${unit}` : text);

  // ---- elements

  function make(tag, given = {}, ...children) {
    const made = document.createElement(tag);
    for (const [name, value] of Object.entries(given)) {
      if (name in made) made[name] = value;
      else made.setAttribute(name, value);
    }
    made.append(...children);
    return made;
  }

  function text(id, words) {
    const place = element(id);
    if (place.textContent !== words) place.textContent = words;
  }

  // Codes of warnings, each a link to its entry where there is one.
  function codes(listed) {
    const parts = document.createDocumentFragment();
    for (const code of listed.split(" ").filter(Boolean)) {
      if (parts.childNodes.length) parts.append(", ");
      parts.append(Object.hasOwn(known.explained, code) ? make("a", { className: "code", href: `#warning-${code}` }, code) : code);
    }
    return parts;
  }

  // A button that copies a text; the clipboard of the browser needs a secure page, which a file is not.
  function copier(words, label) {
    const button = make("button", { type: "button", className: "copy", ariaLabel: label, title: words }, "Copy command");
    button.addEventListener("click", (event) => {
      event.stopPropagation();
      const area = make("textarea", { value: words, className: "copied" });
      document.body.append(area);
      area.select();
      const done = document.execCommand("copy");
      area.remove();
      button.focus();
      button.textContent = done ? "Copied" : "Not copied";
    });
    return button;
  }

  const quantity = (k) => known.quantities[k];
  const titleOf = (k) => `${quantity(k).words ? `${quantity(k).words} ` : ""}${quantity(k).label}`;

  return {
    change, codes, column, columns, copier, counted, day, element, known, make, measured, MISSING, number, numbers, probability, quantity,
    signed, text, titleOf, withUnit,
  };
})();
