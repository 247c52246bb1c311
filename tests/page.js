// Runs the scripts of a page without a browser: `node page.js PAGE FRAGMENT WIDTH` prints the value of the expression
// on its input as JSON. The document has the elements that the script of the fields names, and no chart.
"use strict";
const fs = require("fs"), vm = require("vm");
const [page, fragment, width] = process.argv.slice(2), html = fs.readFileSync(page, "utf8"), elements = {};

function element(name) {
  const attributes = {}, children = [], listeners = {};
  return { name, attributes, children, listeners, dataset: {}, textContent: "", value: "0",
    checked: html.includes(`id="${name}" checked`), parentElement: { clientWidth: Number(width) },
    setAttribute: (key, value) => { attributes[key] = String(value); },
    append: (...others) => children.push(...others), add() {}, replaceChildren: () => children.splice(0),
    addEventListener: (kind, listener) => { listeners[kind] = listener; },
    getBoundingClientRect: () => ({ left: 0, top: 0 }) };
}

const none = () => {}, context = { atob, console, URLSearchParams, Option: class {}, setInterval, clearInterval };
context.document = { querySelectorAll: () => [], documentElement: element("html"), addEventListener: none,
  getElementById: id => elements[id] ??= element(id), createElementNS: (_, name) => element(name) };
context.window = { innerHeight: 900, addEventListener: none };
context.location = { hash: fragment };
vm.createContext(context);
const block = /<script type="application\/json" id="fields">(.*?)<\/script>/s.exec(html);
context.document.getElementById("fields").textContent = block[1];
const scripts = [...html.matchAll(/<script>(.*?)<\/script>/gs)].map(match => match[1]).join("\n");
vm.runInContext(scripts, context);
process.stdout.write(JSON.stringify(vm.runInContext(fs.readFileSync(0, "utf8"), context)));
