// The first script: shows errors in the page.
"use strict";
window.addEventListener("error", event => {
  const place = document.getElementById("errors");
  place.hidden = false;
  place.textContent += event.message + "\n";
});
