"use strict";
// The list of the index: filters, order, and what the map shows. All data is in the page; nothing is fetched.
(() => {
  const data = JSON.parse(document.getElementById("crashes-data").textContent);
  const PAGE = 25;
  const STATES = ["verified", "first_event_only", "rejected", "failed", "pending"];
  const words = (value) => (value ? data.words[value] || String(value).replaceAll("_", " ") : "–");
  const plain = (text) => ` ${text.toLowerCase().replaceAll("non-", "non").replace(/[^\p{L}\p{N}]+/gu, " ")} `;
  const crashes = data.key.map((key, i) => {
    const crash = { key };
    for (const [name, column] of Object.entries(data.coded)) crash[name] = column.values[column.codes[i]];
    for (const [name, column] of Object.entries(data.plain)) crash[name] = column[i];
    crash.rank = STATES.indexOf(crash.final_state);
    // Values as they are stored and as they are called, so that both are found.
    crash.text = plain([key, ...Object.keys(data.coded).flatMap((name) => [crash[name] ?? "", words(crash[name])])].join(" "));
    return crash;
  });
  const form = document.querySelector(".filters");
  const fields = [...form.elements].filter((field) => field.name);
  const body = document.querySelector("#crashes tbody");
  const count = document.getElementById("count");
  const more = document.getElementById("more");
  let shown = PAGE;
  let picked = null; // crashes chosen on the map
  let order = { column: "final_state", sign: 1 };

  const classes = [...document.querySelectorAll("#crashes thead th")].map((th) => th.className);
  const cell = (row, content) => {
    const td = row.insertCell();
    td.className = classes[row.cells.length - 1];
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
    state.textContent = words(crash.outdated ? `${crash.final_state}, outdated` : crash.final_state);
    cell(row, state);
    cell(row, words(crash.grade));
    cell(row, words(crash.reason));
    cell(row, crash.place || crash.state_name || "–");
    cell(row, words(crash.kind));
    cell(row, words(crash.collision_type));
    cell(row, words(crash.road_topology));
    cell(row, words(crash.vehicle_trajectory));
    cell(row, crash.contact_distance_m == null ? "–" : `${(crash.contact_distance_m / 0.3048).toFixed(1)} (${crash.contact_distance_m.toFixed(1)})`);
    return row;
  }

  function compare(one, two) {
    const column = order.column === "final_state" ? "rank" : order.column;
    const [a, b] = [one[column], two[column]];
    if (a == null || b == null) return (a == null) - (b == null) || (one.key < two.key ? -1 : 1);
    return (a < b ? -1 : a > b ? 1 : one.key < two.key ? -1 : 1) * order.sign;
  }

  const selects = fields.filter((field) => field.name !== "search");
  const valuesOf = (crash, name) => crash[name] == null ? [] : name === "vehicle_classes" ? crash[name].split(", ") : [String(crash[name])];
  // The crashes that fit, whatever one field, `but`, says.
  function matches(but) {
    const wanted = selects.filter((field) => field.value && field !== but).map((field) => [field.name, field.value]);
    // Words are found by their beginnings, numbers of a house, street or limit whole.
    const text = but === form.elements.search ? [] : plain(form.elements.search.value).split(" ").filter(Boolean).map((word) => (/^\p{N}{1,3}$/u.test(word) ? ` ${word} ` : ` ${word}`));
    return crashes.filter((crash) =>
      (!picked || picked.has(crash)) &&
      wanted.every(([name, value]) => valuesOf(crash, name).includes(value)) &&
      text.every((word) => crash.text.includes(word)));
  }
  // Beside each value of a filter stands how many crashes it would leave.
  function countValues() {
    const all = matches();
    for (const field of selects) {
      const left = new Map();
      for (const crash of field.value ? matches(field) : all) for (const value of valuesOf(crash, field.name)) left.set(value, (left.get(value) || 0) + 1);
      for (const option of field.options) if (option.value) option.textContent = `${words(option.value)} (${left.get(option.value) || 0})`;
    }
  }
  // Where nothing fits, what to change: each filter without which something would.
  function sayWhatToChange() {
    const set = fields.filter((field) => field.value).map((field) => [field, matches(field).length]).filter(([, n]) => n);
    if (!set.length) { count.append(" Several filters together leave none: “Show all” begins anew."); return; }
    for (const [field, n] of set) {
      const button = document.createElement("button");
      button.type = "button";
      button.textContent = `Without “${field.labels[0].firstChild.textContent}: ${words(field.value)}”: ${n}`;
      button.addEventListener("click", () => { field.value = ""; form.dispatchEvent(new Event("input")); });
      count.append(" ", button);
    }
  }

  function list(found) {
    body.replaceChildren(...found.slice().sort(compare).slice(0, shown).map(rowOf));
    count.textContent = `${found.length.toLocaleString("en")} of ${crashes.length.toLocaleString("en")} crashes${picked ? ", at the place chosen on the map" : ""}`;
    if (!found.length) sayWhatToChange();
    more.hidden = found.length <= shown;
    more.textContent = `Show ${Math.min(PAGE, found.length - shown)} more`;
  }

  let seen = ""; // the part of the map that was chosen; without, all crashes shown are seen
  const map = window.crashMap(document.getElementById("map"), (chosen) => { picked = new Set(chosen); update(false); }, (all) => {
    seen = all ? "" : map.seen;
    toAddress();
  });

  function update(fit = true) {
    shown = PAGE;
    const found = matches();
    list(found);
    countValues();
    if (!picked) map.show(found, fit);
  }

  function toAddress() {
    const set = fields.filter((field) => field.value).map((field) => [field.name, field.value]);
    document.getElementById("chosen").textContent = set.length ? ` (${set.length} chosen)` : "";
    if (seen) set.push(["map", seen]);
    history.replaceState(null, "", set.length ? `#${new URLSearchParams(set)}` : "#");
  }

  function fromAddress() {
    const asked = new URLSearchParams(location.hash.slice(1));
    if (![...asked.keys()].some((name) => name === "map" || form.elements[name])) return;
    fields.forEach((field) => { field.value = asked.get(field.name) || ""; });
    picked = null;
    update();
    seen = asked.get("map") || "";
    if (seen) map.look(seen);
    toAddress();
  }

  form.addEventListener("submit", (event) => event.preventDefault());
  form.addEventListener("input", () => { picked = null; seen = ""; toAddress(); update(); });
  form.addEventListener("reset", (event) => {
    event.preventDefault();
    fields.forEach((field) => { field.value = ""; });
    picked = null;
    seen = "";
    toAddress();
    update();
  });
  window.addEventListener("hashchange", () => { fromAddress(); document.getElementById("crashes-title").scrollIntoView(); });
  more.addEventListener("click", () => { shown += PAGE; list(matches()); });
  document.querySelectorAll("th button[data-column]").forEach((button) => button.addEventListener("click", () => {
    const column = button.dataset.column;
    order = { column, sign: order.column === column ? -order.sign : 1 };
    document.querySelectorAll("th[aria-sort]").forEach((th) => th.removeAttribute("aria-sort"));
    button.parentElement.setAttribute("aria-sort", order.sign > 0 ? "ascending" : "descending");
    list(matches());
  }));
  if (matchMedia("(max-width: 40rem)").matches) document.getElementById("filters").open = false;
  update();
  fromAddress();
})();
