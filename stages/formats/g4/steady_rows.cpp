#include "stages/formats/g4/steady_rows.h"

#include <algorithm>

#include "stages/formats/g4/horizontal.h"

namespace lamina::formats::g4 {
namespace {

/// From change `at` of a task on, those that take horizontal mode: a far one, and with it the next of its row.
/// returns  the first that does not, or that is the last of `count` and not of its row
std::uint32_t put_horizontals(BitWriter& writer, const StepsTask& task, const Steps& steps, std::uint32_t at,
                              std::uint32_t count) {
  const std::uint32_t usable = steps.keeps & steps.far, ends = task.ends.bits();
  while (at < count && (usable >> at & 1) != 0) {
    const std::uint32_t* const change = task.change + at;
    const bool first = at == 0 ? task.ends.position() == 0 : (ends >> (at - 1) & 1) != 0;
    const std::uint32_t before = first ? 0 : change[-1];
    if ((ends >> at & 1) != 0) {  // the other run reaches the end of the row; rows have pairs of changes, so it is white
      put_horizontal(writer, 1, change[0] - before, task.columns - change[0]);
      at += 1;
      continue;
    }
    if ((steps.keeps >> (at + 1) & 1) == 0) break;
    put_horizontal(writer, (task.ends.position() + at) & 1, change[0] - before, change[1] - change[0]);
    if ((ends >> (at + 1) & 1) != 0) writer.put(kVertical[3]);
    at += 2;
  }
  return at;
}

}  // namespace

std::uint32_t put_steady_rows(BitWriter& writer, const SteadyRows& rows, const StepsBody& body) {
  const std::uint32_t total = rows.changes * rows.rows;
  BitWriter out = writer;
  StepsTask task{rows.change, total, rows.changes, rows.columns, RowEnds(rows.changes, body.lanes)};
  Steps steps;
  for (;;) {
    body.put(out, task, steps);
    if (task.left == 0) break;
    const std::uint32_t count = std::min(body.lanes, task.left);
    std::uint32_t at = steps.count;
    if (at != 0) put_words(out, steps);
    if (at < count) at = put_horizontals(out, task, steps, at, count);
    task.left -= at;
    // A change that keeps no step stops, and so does a far one before such.
    const bool stops = at < count && (steps.keeps >> at & 1) == 0;
    const bool before_stop = at + 1 < count && (steps.keeps >> at & steps.far >> at & 1) != 0;
    if (stops || before_stop || task.left == 0) break;
    task.change += at;
    task.ends.advance(at);
  }
  writer = out;
  return total - task.left;
}

}  // namespace lamina::formats::g4
