"use strict";
// Every table can be copied, a long one sorted and filtered. The page is whole without this.
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
  const filter = document.createElement("input");
  filter.type = "search";
  filter.placeholder = "filter rows";
  filter.setAttribute("aria-label", "Filter the rows of this table");
  filter.addEventListener("input", () => {
    const wanted = filter.value.toLowerCase();
    for (const row of body.rows) row.hidden = !row.innerText.toLowerCase().includes(wanted);
  });
  caption.append(" ", filter);
  [...table.tHead.rows[0].cells].forEach((head, k) => {
    const label = head.textContent;
    const up = button(label, `Sort by ${label}`, () => {
      const rising = head.getAttribute("aria-sort") !== "ascending";
      for (const other of table.tHead.rows[0].cells) other.removeAttribute("aria-sort");
      head.setAttribute("aria-sort", rising ? "ascending" : "descending");
      const value = (row) => row.cells[k] ? row.cells[k].innerText.trim() : "";
      const number = (text) => parseFloat(text.replace("−", "-").replace("[", ""));
      const rows = [...body.rows].sort((a, b) => {
        const [x, y] = [value(a), value(b)];
        const [m, n] = [number(x), number(y)];
        return Number.isNaN(m) || Number.isNaN(n) ? x.localeCompare(y) : m - n;
      });
      body.append(...(rising ? rows : rows.reverse()));
    });
    head.replaceChildren(up);
  });
}
