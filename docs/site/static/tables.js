// Sort a table by a click or Enter on a heading; tables of twelve rows or more get a field that filters their rows.
// A column of long texts has a least width, and a table wider than the page scrolls within it.
"use strict";

function cellText(row, column) {
  return row.cells[column] ? row.cells[column].innerText.trim() : "";
}

function compare(a, b) {
  const [x, y] = [parseFloat(a), parseFloat(b)];
  return Number.isNaN(x) || Number.isNaN(y) ? a.localeCompare(b, "en", { numeric: true }) : x - y;
}

function sortBy(table, heading) {
  const column = heading.cellIndex;
  const falling = heading.getAttribute("aria-sort") === "ascending";
  const body = table.tBodies[0];
  const rows = [...body.rows].sort((a, b) => compare(cellText(a, column), cellText(b, column)));
  for (const other of table.tHead.rows[0].cells) other.removeAttribute("aria-sort");
  heading.setAttribute("aria-sort", falling ? "descending" : "ascending");
  body.append(...(falling ? rows.reverse() : rows));
}

function makeSortable(table) {
  for (const heading of table.tHead.rows[0].cells) {
    heading.tabIndex = 0;
    heading.title = "Sort by this column";
    heading.addEventListener("click", () => sortBy(table, heading));
    heading.addEventListener("keydown", (event) => {
      if (event.key === "Enter") sortBy(table, heading);
    });
  }
}

function addFilter(table) {
  const field = document.createElement("input");
  field.type = "search";
  field.className = "table-filter";
  field.placeholder = "Filter the rows";
  field.setAttribute("aria-label", "Filter the rows of the table");
  const rows = [...table.tBodies[0].rows];
  field.addEventListener("input", () => {
    const words = field.value.toLowerCase().split(/\s+/);
    for (const row of rows) {
      const text = row.innerText.toLowerCase();
      row.hidden = !words.every((word) => text.includes(word));
    }
  });
  (table.closest(".table-wrapper") || table).before(field);
}

// Least widths of columns by the length of their longest text; longer words are broken.
const WIDTHS = [[200, "14em"], [50, "9em"], [22, "7em"]];
const LONGEST_WORD = 34;

function widenColumns(table) {
  const rows = [...table.tBodies[0].rows];
  for (const heading of table.tHead.rows[0].cells) {
    const texts = rows.map((row) => cellText(row, heading.cellIndex));
    const width = WIDTHS.find(([length]) => texts.some((text) => text.length >= length));
    if (width) heading.style.minWidth = width[1];
    if (texts.some((text) => text.split(/\s/).some((word) => word.length > LONGEST_WORD)))
      for (const row of rows) if (row.cells[heading.cellIndex]) row.cells[heading.cellIndex].style.overflowWrap = "anywhere";
  }
}

document.addEventListener("DOMContentLoaded", () => {
  for (const table of document.querySelectorAll("article table")) {
    if (!table.tHead || !table.tBodies.length) continue;
    widenColumns(table);
    const count = table.tBodies[0].rows.length;
    if (count >= 3) makeSortable(table);
    if (count >= 12) addFilter(table);
  }
});
