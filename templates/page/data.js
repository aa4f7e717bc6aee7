// What Python wrote into the page.

const DATA = JSON.parse(document.getElementById("data").textContent);
