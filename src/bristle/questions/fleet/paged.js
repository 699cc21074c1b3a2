// A table of many rows, shown a page at a time; sorted by its headings, filtered by words.
"use strict";
fleet.paged = (() => {
  const { element, make } = fleet;
  const SIZE = innerWidth < 640 ? 10 : 20;

  // Of a text that begins with a number, the number: so that `+15.2 [12.1, 18.3]` sorts by its size.
  function key(value) {
    if (typeof value !== "string") return value;
    const found = parseFloat(value.replace("−", "-").replace(/^[<(]\s*/, ""));
    return Number.isNaN(found) ? value : found;
  }

  function compare(a, b) {
    const missing = (x) => x === "" || x === fleet.MISSING || Number.isNaN(x);
    if (missing(a) || missing(b)) return Number(missing(a)) - Number(missing(b));
    if (typeof a === "number" && typeof b === "number") return a - b;
    return String(a).localeCompare(String(b), "en", { numeric: true });
  }

  // name: of table and pager; count: rows; cells: [{ show(k), by(k), kind }] as the head has them; words(k): what a filter looks in;
  // keep: { label, ways: { name: k => whether } }; choose(k): where a row can be chosen.
  return ({ name, count, cells, words, keep, choose }) => {
    const table = element(`table-${name}`), body = table.tBodies[0], heads = [...table.tHead.rows[0].cells];
    const pager = element(`pager-${name}`), title = table.caption.firstChild.textContent.trim();
    const state = { page: 0, rows: [], order: null, falling: false, filter: "", way: keep ? Object.keys(keep.ways)[0] : "", chosen: -1 };
    const every = Array.from({ length: count }, (_, k) => k);

    const button = (text, label, act) => {
      const made = make("button", { type: "button", ariaLabel: `${label}: ${title}` }, text);
      made.addEventListener("click", act);
      return made;
    };
    const go = (page) => () => { state.page = page(); draw(); };
    const last = () => Math.max(Math.ceil(state.rows.length / SIZE) - 1, 0);
    const first = button("«", "First page", go(() => 0));
    const back = button("‹ Back", "Page before", go(() => Math.max(state.page - 1, 0)));
    const next = button("Next ›", "Next page", go(() => Math.min(state.page + 1, last())));
    const end = button("»", "Last page", go(last));
    const status = make("span", { role: "status" });
    const filter = make("input", { type: "search", placeholder: "filter rows", ariaLabel: `Filter rows: ${title}` });
    filter.addEventListener("input", () => { state.filter = filter.value.toLowerCase(); sift(); });

    function sift() {
      const sought = state.filter.split(/\s+/).filter(Boolean), kept = keep ? keep.ways[state.way] : () => true;
      const found = every.filter((k) => kept(k) && (!sought.length || sought.every((word) => words(k).includes(word))));
      if (state.order !== null) {
        const { by } = cells[state.order], values = new Map(found.map((k) => [k, key(by(k))]));
        const way = state.falling ? -1 : 1;
        const gone = (x) => x === "" || x === fleet.MISSING || Number.isNaN(x);
        found.sort((a, b) => {
          const [x, y] = [values.get(a), values.get(b)];
          return (gone(x) || gone(y) ? compare(x, y) : way * compare(x, y)) || a - b;
        });
      }
      state.rows = found;
      state.page = 0;
      draw();
    }

    function row(k) {
      const made = make("tr", choose ? { className: "choosable" } : {});
      cells.forEach(({ show, kind }, at) => {
        const shown = show(k), cell = make(at ? "td" : "th", { className: kind || "" });
        if (!at) cell.scope = "row";
        cell.append(...[shown].flat());
        made.append(cell);
      });
      if (!choose) return made;
      if (k === state.chosen) made.classList.add("chosen");
      made.addEventListener("click", (event) => { if (!event.target.closest("a, button:not(.choose)")) pick(k); });
      return made;
    }

    function draw() {
      const begin = state.page * SIZE, shown = state.rows.slice(begin, begin + SIZE);
      body.replaceChildren(...shown.map(row));
      for (const one of [first, back]) one.disabled = state.page === 0;
      for (const one of [next, end]) one.disabled = state.page >= last();
      const of = state.rows.length === count ? `${count}` : `${state.rows.length} that match, of ${count}`;
      status.textContent = shown.length ? `${begin + 1} to ${begin + shown.length} of ${of}` : `no rows of ${count}`;
    }

    function pick(k) {
      state.chosen = k;
      const focused = body.contains(document.activeElement);
      draw();
      if (focused) body.querySelector("tr.chosen button.choose")?.focus();
      choose(k);
    }

    heads.forEach((head, at) => {
      const label = head.textContent;
      const by = make("button", { type: "button", ariaLabel: `Sort by ${label}` }, label);
      by.addEventListener("click", () => {
        const risen = head.getAttribute("aria-sort") === "ascending";
        for (const other of heads) other.removeAttribute("aria-sort");
        head.setAttribute("aria-sort", risen ? "descending" : "ascending");
        [state.order, state.falling] = [at, risen];
        sift();
      });
      head.replaceChildren(by);
    });
    if (count > SIZE || keep) pager.append(filter);
    if (keep) {
      const choice = make("select", { ariaLabel: `${keep.label}: ${title}` }, ...Object.keys(keep.ways).map((way) => new Option(way, way)));
      choice.addEventListener("change", () => { state.way = choice.value; sift(); });
      pager.append(choice);
    }
    if (count > SIZE) pager.append(first, back, next, end);
    pager.append(status);
    pager.hidden = count <= SIZE && !keep;
    sift();
    return { pick, sift, shown: () => state.rows.slice(state.page * SIZE, (state.page + 1) * SIZE), state };
  };
})();
