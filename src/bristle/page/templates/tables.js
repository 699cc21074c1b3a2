"use strict";
// Every table can be copied, a long one sorted and filtered, and one of many rows turned over. The page is whole without this.
const PAGE = 50; // rows
for (const table of document.querySelectorAll("table")) {
  const body = table.tBodies[0];
  const caption = table.caption || table.createCaption();
  const button = (text, label, act) => {
    const made = document.createElement("button");
    made.type = "button";
    made.textContent = text;
    made.setAttribute("aria-label", label);
    made.addEventListener("click", () => act(made));
    return made;
  };
  caption.append(" ", button("Copy", "Copy this table", async (self) => {
    const lines = [...table.rows].filter((row) => !row.hidden).map((row) => [...row.cells].map((c) => c.innerText.trim()).join("\t"));
    const area = document.createElement("textarea");
    area.value = lines.join("\n");
    document.body.append(area);
    area.select();
    const done = document.execCommand("copy");
    area.remove();
    self.textContent = done ? "Copied" : "Not copied";
  }));
  if (!table.classList.contains("long")) continue;

  // What each row says, read once: a filter keeps rows with every word, and of those a page is shown.
  const said = new Map([...body.rows].map((row) => [row, row.textContent.toLowerCase()]));
  const many = said.size > PAGE, place = document.createElement("span");
  let wanted = [], begin = 0;
  const show = () => {
    const found = [...body.rows].filter((row) => wanted.every((word) => said.get(row).includes(word)));
    begin = Math.min(Math.max(begin, 0), Math.max(PAGE * (Math.ceil(found.length / PAGE) - 1), 0));
    const shown = new Set(many ? found.slice(begin, begin + PAGE) : found);
    for (const row of body.rows) row.hidden = !shown.has(row);
    const of = found.length === said.size ? "" : `, of ${said.size}`;
    place.textContent = shown.size ? `${begin + 1} to ${begin + shown.size} of ${found.length}${of}` : `no row of ${said.size}`;
  };
  const filter = document.createElement("input");
  filter.type = "search";
  filter.placeholder = "filter rows";
  filter.setAttribute("aria-label", "Filter the rows of this table");
  filter.addEventListener("input", () => {
    wanted = filter.value.toLowerCase().split(/\s+/).filter(Boolean);
    begin = 0;
    show();
  });
  caption.append(" ", filter);
  if (many) {
    const turn = (by) => () => { begin += by; show(); };
    place.setAttribute("role", "status");
    const pager = document.createElement("p");
    pager.className = "pager";
    pager.append(button("‹ Back", "Page before", turn(-PAGE)), place, button("Next ›", "Next page", turn(PAGE)));
    table.parentElement.after(pager);
    show();
  }
  [...table.tHead.rows[0].cells].forEach((head, k) => {
    const label = head.textContent;
    const up = button(label, `Sort by ${label}`, () => {
      const rising = head.getAttribute("aria-sort") !== "ascending";
      for (const other of table.tHead.rows[0].cells) other.removeAttribute("aria-sort");
      head.setAttribute("aria-sort", rising ? "ascending" : "descending");
      const text = (row) => row.cells[k] ? row.cells[k].textContent.trim() : "";
      const number = (x) => parseFloat(x.replace("−", "-").replace(/^[[(<]\s*/, ""));
      const keys = new Map([...body.rows].map((row) => [row, [text(row), number(text(row))]]));
      const missing = ([x]) => x === "" || x === "–"; // last, whichever way
      const rows = [...body.rows].sort((a, b) => {
        const [x, y] = [keys.get(a), keys.get(b)];
        if (missing(x) || missing(y)) return missing(x) - missing(y);
        const order = Number.isNaN(x[1]) || Number.isNaN(y[1]) ? x[0].localeCompare(y[0]) : x[1] - y[1];
        return rising ? order : -order;
      });
      body.append(...rows);
      begin = 0;
      show();
    });
    head.replaceChildren(up);
  });
}
