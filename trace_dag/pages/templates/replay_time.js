// The controls and keys of a time line that ends at `end` (s). `draw` shows a moment; the clock is `draw`'s answer. Around
// the `impact` (s, or null) time runs slower if that is chosen.
const SLOW = { before: .4, after: .8, rate: .25 };
// `events` are the reported ones: in words below the line, those that do not happen struck out, and a mark where each is.
function timeline(end, draw, impact, events = []) {
  const line = { now: 0, show, stop };
  let playing = false, last = 0;
  function show(t) {
    line.now = Math.min(end, Math.max(0, t));
    $("time").value = line.now;
    $("clock").textContent = line.now.toFixed(2) + " s" + draw(line.now);
    for (const { time, told } of marks) told.classList.toggle("past", time !== null && line.now >= time);
  }
  function stop() { playing = false; $("play").textContent = "Play"; }
  function play() { if (line.now >= end) line.now = 0; playing = true; $("play").textContent = "Pause"; last = performance.now(); requestAnimationFrame(tick); }
  function tick(stamp) {
    if (!playing) return;
    show(line.now + (stamp - last) / 1000 * rate());
    last = stamp;
    if (line.now >= end) stop(); else requestAnimationFrame(tick);
  }
  function rate() {
    if ($("rate").value !== "slow") return Number($("rate").value);
    return impact !== null && line.now > impact - SLOW.before && line.now < impact + SLOW.after ? SLOW.rate : 1;
  }
  function toggle() { if (playing) stop(); else play(); }
  function step(by) { stop(); show(line.now + by); }
  $("play").addEventListener("click", toggle);
  $("back").addEventListener("click", () => step(-.02));
  $("forward").addEventListener("click", () => step(.02));
  $("time").max = end;
  const marks = events.toSorted((one, two) => (one.time ?? Infinity) - (two.time ?? Infinity) || one.number - two.number).map(({ number, time, words }) => {
    const mark = document.createElement("button"), told = document.createElement("li");
    Object.assign(mark, { textContent: number, title: words, className: time === null ? "missed" : "" });
    mark.setAttribute("aria-label", words);
    if (time !== null) mark.addEventListener("click", () => { stop(); show(time); });
    $("events").append(mark);
    told.append(words + (time === null ? "" : `, at ${time.toFixed(2)} s`));
    told.className = mark.className;
    $("told").append(told);
    return { mark, time, told };
  });
  // Marks of one moment stand side by side, those of what does not happen at the right, and none leaves the line.
  function place() {
    const width = $("events").clientWidth, apart = 28;
    let least = 0, most = width;
    for (const each of marks) least = apart + (each.at = Math.max(least, each.time === null ? width : width * each.time / (end || 1)));
    for (const each of marks.toReversed()) most = (each.at = Math.min(most, each.at)) - apart;
    for (const { mark, at } of marks) mark.style.left = `${100 * at / (width || 1)}%`; // right at once in another width
  }
  new ResizeObserver(place).observe($("events"));
  $("time").addEventListener("input", () => { stop(); show(Number($("time").value)); });
  document.addEventListener("keydown", e => {
    if (e.defaultPrevented || e.target.tagName === "SELECT") return;
    if (e.key === " ") { e.preventDefault(); toggle(); } // a button is pressed with Enter
    if (e.key === "ArrowLeft") { e.preventDefault(); step(e.shiftKey ? -.5 : -.02); }
    if (e.key === "ArrowRight") { e.preventDefault(); step(e.shiftKey ? .5 : .02); }
    if (e.key === "Home") step(-end);
  });
  return line;
}
