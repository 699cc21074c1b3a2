// View 6: the values as YAML, as JSON, and as a link whose numbers are parsed and clamped when it is opened.
"use strict";
explorer.views.values = (() => {
  const { clamped, element, joint, option, options, row, say, set, sliders, state, text, unitOf } = explorer;

  const fields = () => bristle.laws[joint().law].FIELDS;

  function current() {
    return {
      joint: joint().name,
      simulated: joint().simulated,
      start_of: set().label,
      law: joint().law,
      units: Object.fromEntries(fields().map((name) => [name, unitOf(name).replaceAll("·", "*").replaceAll("²", "**2")])),
      values: Object.fromEntries(joint().directions.map((d) => [d, { ...state.values[d] }])),
    };
  }

  // JSON's texts and numbers are YAML's too.
  function yaml(part, indent = "") {
    return Object.entries(part).map(([key, x]) => {
      const name = /^[a-z_0-9]+$/i.test(key) ? key : JSON.stringify(key);
      return x !== null && typeof x === "object" ? `${indent}${name}:\n${yaml(x, `${indent}  `)}` : `${indent}${name}: ${JSON.stringify(x)}\n`;
    }).join("");
  }

  function fragment() {
    const q = new URLSearchParams({ joint: state.joint, set: state.set, direction: state.direction, view: state.view });
    for (const d of joint().directions) q.set(`values${d}`, sliders().map((name) => state.values[d][name]).join(" "));
    for (const field of options()) q.set(field.id, String(option(field.id)));
    return `#${q}`;
  }

  // The state of a link: every number is parsed and clamped, every word is one that the page knows, or it is left.
  function restore(hash) {
    if (hash.length < 2) return;
    const q = new URLSearchParams(hash.slice(1));
    explorer.chooseJoint(Number(q.get("joint")));
    explorer.chooseSet(Number(q.get("set")));
    if (joint().directions.includes(q.get("direction"))) {
      state.direction = q.get("direction");
      element("direction").value = state.direction;
    }
    for (const d of joint().directions) {
      const given = (q.get(`values${d}`) || "").split(/[ +]/).map((x) => (x === "" ? NaN : Number(x)));
      sliders().forEach((name, k) => { state.values[d][name] = clamped(name, given[k] ?? NaN, state.values[d][name]); });
    }
    for (const field of options()) {
      const x = q.get(field.id);
      if (x === null) continue;
      if (field.type === "checkbox") field.checked = x === "true";
      else if (field.tagName === "SELECT") {
        const found = [...field.options].find((one) => one.value === x && !one.disabled);
        if (found) field.value = found.value;
      } else if (Number.isFinite(Number(x)) && x.trim()) {
        field.value = String(Math.min(Math.max(Number(x), Number(field.min || -Infinity)), Number(field.max || Infinity)));
      }
    }
    for (const view of Object.values(explorer.views)) if (view.chosen) view.chosen("");
    explorer.chooseView(q.get("view"));
  }

  async function copy(words, what) {
    try {
      await navigator.clipboard.writeText(words);
    } catch {
      const field = element("copied");
      field.value = words;
      field.hidden = false;
      field.select();
      const done = document.execCommand("copy");
      field.hidden = true;
      if (!done) return say(`${what} cannot be copied here; mark the text and copy it.`);
    }
    say(`${what} copied.`);
  }

  const json = () => JSON.stringify(current(), null, 1);
  const link = () => location.href.split("#")[0] + fragment();

  function draw() {
    const rows = fields().map((name) => {
      const cells = ["+", "-"].flatMap((d) => {
        const own = joint().directions.includes("both") ? "both" : d, x = state.values[own]?.[name], identified = set().values[own]?.[name].value;
        return [explorer.shown(x, 6), identified ? `${explorer.shown(100 * (x / identified - 1), 3)} %` : "–"];
      });
      return row(explorer.settings.symbols[name], [...cells, unitOf(name)]);
    });
    element("value-rows").replaceChildren(...rows);
    text("as-yaml", yaml(current()));
    text("as-json", json());
    element("as-link").value = link();
  }

  function listen() {
    element("copy-yaml").addEventListener("click", () => copy(yaml(current()), "YAML"));
    element("copy-json").addEventListener("click", () => copy(json(), "JSON"));
    element("copy-link").addEventListener("click", () => {
      history.replaceState(null, "", fragment());
      copy(link(), "Link");
    });
  }
  listen();

  return { draw, restore, fragment, current };
})();
