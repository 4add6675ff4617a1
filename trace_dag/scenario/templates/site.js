"use strict";
// Filters the table and the map of the index. All data is in the page; nothing is fetched.
(() => {
  const crashes = JSON.parse(document.getElementById("crashes-data").textContent);
  const body = document.querySelector("#crashes tbody");
  const selects = [...document.querySelectorAll(".filters select")];
  const search = document.getElementById("search");
  const count = document.getElementById("count");
  const more = document.getElementById("more");
  const points = new Map([...document.querySelectorAll(".map circle")].map((c) => [c.dataset.key, c]));
  const PAGE = 100;
  let shown = PAGE;

  const words = (value) => (value ? String(value).replaceAll("_", " ") : "–");
  const cell = (row, content, name) => {
    const td = row.insertCell();
    if (name) td.className = name;
    if (content instanceof Node) td.append(content); else td.textContent = content;
  };

  function rowOf(crash) {
    const row = document.createElement("tr");
    const link = document.createElement("a");
    link.href = `crashes/${crash.key}.html`;
    link.textContent = crash.key;
    cell(row, link);
    const state = document.createElement("span");
    state.className = `state ${crash.final_state}`;
    state.textContent = crash.final_state;
    cell(row, state);
    cell(row, words(crash.reason));
    cell(row, crash.place || "–", "wide");
    cell(row, words(crash.collision_type));
    cell(row, words(crash.road_topology), "wide");
    cell(row, words(crash.vehicle_trajectory), "wide");
    cell(row, crash.contact_distance_m == null ? "–" : crash.contact_distance_m.toFixed(2), "number");
    return row;
  }

  function update() {
    const wanted = selects.filter((s) => s.value).map((s) => [s.name, s.value]);
    const text = search.value.trim().toLowerCase();
    const matches = crashes.filter((crash) =>
      wanted.every(([name, value]) => String(crash[name]) === value) &&
      (!text || `${crash.key} ${crash.place || ""} ${crash.state_name || ""}`.toLowerCase().includes(text)));
    body.replaceChildren(...matches.slice(0, shown).map(rowOf));
    const kept = new Set(matches.map((crash) => crash.key));
    points.forEach((circle, key) => circle.classList.toggle("out", !kept.has(key)));
    count.textContent = `${matches.length} of ${crashes.length} crashes`;
    more.hidden = matches.length <= shown;
    more.textContent = `Show ${Math.min(PAGE, matches.length - shown)} more`;
  }

  const restart = () => { shown = PAGE; update(); };
  selects.forEach((select) => select.addEventListener("change", restart));
  search.addEventListener("input", restart);
  document.getElementById("reset").addEventListener("click", () => {
    selects.forEach((select) => { select.value = ""; });
    search.value = "";
    restart();
  });
  more.addEventListener("click", () => { shown += PAGE; update(); });
  points.forEach((circle, key) => circle.addEventListener("click", () => { location.href = `crashes/${key}.html`; }));
  update();
})();
