// Long columns are kept as second differences of whole numbers, `per` a unit; see trace_dag/scenario/replay_columns.py.
function column(name, kept) {
  if (!kept?.by) return kept;
  const { by, per, width } = kept, rows = by.length / (width || 1), columns = [];
  for (let start = 0; start < by.length; start += rows) {
    let step = 0, sum = 0;
    columns.push(by.slice(start, start + rows).map(each => (sum += step += each) / per));
  }
  return width ? columns[0].map((_, k) => columns.map(each => each[k])) : columns[0];
}
