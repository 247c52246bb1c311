// Sort a table by a click or Enter on a heading; tables of twelve rows or more get a field that filters their rows, and
// long ones a menu for each column of few different entries.
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
  const menus = [...table.tHead.rows[0].cells].map((heading) => menuOf(heading, rows)).filter(Boolean);
  const filter = () => {
    const words = field.value.toLowerCase().split(/\s+/);
    for (const row of rows) {
      const text = row.innerText.toLowerCase();
      row.hidden = !(words.every((word) => text.includes(word)) && menus.every((menu) => menu.accepts(row)));
    }
  };
  const place = table.closest(".table-wrapper") || table;
  for (const { element } of [{ element: field }, ...menus]) {
    element.addEventListener("input", filter);
    place.before(element);
  }
}

// A column of a long table has a menu if its cells, lists with semicolons, have few entries that are not numbers.
const LONG_TABLE = 60;
const MOST_ENTRIES = 30;

function entries(row, column) {
  return cellText(row, column).split("; ").filter(Boolean);
}

function menuOf(heading, rows) {
  const column = heading.cellIndex;
  const known = [...new Set(rows.flatMap((row) => entries(row, column)))].sort();
  const isNumeric = known.every((entry) => !Number.isNaN(Number(entry)));
  if (rows.length < LONG_TABLE || known.length < 2 || known.length > MOST_ENTRIES || isNumeric) return null;
  const element = document.createElement("select");
  element.className = "table-menu";
  element.setAttribute("aria-label", `Choose ${heading.innerText.trim()}`);
  element.append(new Option(`${heading.innerText.trim()}: all`, ""), ...known.map((entry) => new Option(entry)));
  return { element, accepts: (row) => !element.value || entries(row, column).includes(element.value) };
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
