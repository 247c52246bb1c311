// First of all scripts: what goes wrong is told in the page.
"use strict";
window.addEventListener("error", event => {
  const place = document.getElementById("errors");
  place.hidden = false;
  place.textContent += event.message + "\n";
});
