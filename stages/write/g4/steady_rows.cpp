#include "stages/write/g4/steady_rows.h"

#include <algorithm>

#include "stages/write/g4/horizontal.h"

namespace lamina::write::g4 {
namespace {

/// Which of the next changes are the last of their rows.
class RowEnds {
 public:
  RowEnds(std::uint32_t changes, std::uint32_t lanes) : changes_(changes), step_(lanes % changes) {
    for (std::uint32_t end = changes; end <= 64; end += changes) pattern_ |= std::uint64_t{1} << (end - 1);
  }
  /// Bit i: change i from here, i < 16.
  std::uint32_t bits() const {
    if (changes_ <= 48) return static_cast<std::uint32_t>(pattern_ >> place_) & 0xFFFF;
    const std::uint32_t left = changes_ - 1 - place_;
    return left < 16 ? 1u << left : 0;
  }
  void advance(std::uint32_t count) {
    place_ += count;
    if (place_ >= changes_) place_ %= changes_;
  }
  /// By as many as a body takes: nothing here waits for what it finds.
  void advance_all() {
    place_ += step_;
    place_ -= place_ >= changes_ ? changes_ : 0;
  }
  /// Of the next change in its row.
  std::uint32_t place() const { return place_; }

 private:
  std::uint32_t changes_, step_, place_ = 0;
  std::uint64_t pattern_ = 0;
};

inline void put_words(BitWriter& writer, const Steps& steps) {
  const std::uint32_t length = steps.lengths[0] + steps.lengths[1];
  if (length <= 56) [[likely]] {
    writer.put(steps.words[0] << steps.lengths[1] | steps.words[1], length);
    return;
  }
  for (int i = 0; i < 2; ++i) {
    if (steps.lengths[i] > 32) writer.put(steps.words[i] >> 32, steps.lengths[i] - 32);
    const std::uint32_t low = std::min(steps.lengths[i], 32u);
    if (low != 0) writer.put(steps.words[i] & ((std::uint64_t{1} << low) - 1), low);
  }
}

/// From change `at` of a task on, those that take horizontal mode: a far one, and with it the next of its row.
/// returns  the first that does not, or that is the last of the task and not of its row
std::uint32_t put_horizontals(BitWriter& writer, const StepsTask& task, const Steps& steps, std::uint32_t at, bool starts_row) {
  const std::uint32_t usable = steps.keeps & steps.far;
  while (at < task.count && (usable >> at & 1) != 0) {
    const std::uint32_t* const change = task.change + at;
    const bool first = at == 0 ? starts_row : (task.ends >> (at - 1) & 1) != 0;
    const std::uint32_t before = first ? 0 : change[-1];
    if ((task.ends >> at & 1) != 0) {  // the other run reaches the end of the row: rows have pairs of changes, it is white
      put_horizontal(writer, 1, change[0] - before, task.columns - change[0]);
      at += 1;
      continue;
    }
    if ((steps.keeps >> (at + 1) & 1) == 0) break;
    const std::uint32_t place = static_cast<std::uint32_t>(task.change - task.row + at);
    put_horizontal(writer, place & 1, change[0] - before, change[1] - change[0]);
    if ((task.ends >> (at + 1) & 1) != 0) writer.put(kVertical[3]);
    at += 2;
  }
  return at;
}

}  // namespace

std::uint32_t put_steady_rows(BitWriter& writer, const SteadyRows& rows, const StepsBody& body) {
  const std::uint32_t total = rows.changes * rows.rows;
  BitWriter out = writer;
  RowEnds ends(rows.changes, body.lanes);
  StepsTask task{rows.change, rows.change, rows.changes, rows.columns, 0, 0};
  Steps steps;
  std::uint32_t done = 0;
  while (done < total) {
    task.change = rows.change + done;
    task.count = std::min(body.lanes, total - done);
    task.ends = ends.bits() & ((1u << task.count) - 1);
    body.find(task, steps);
    std::uint32_t at = steps.count;
    if (at == body.lanes) [[likely]] {
      put_words(out, steps);
      done += body.lanes;
      ends.advance_all();
      continue;
    }
    if (at != 0) put_words(out, steps);
    if (at < task.count) at = put_horizontals(out, task, steps, at, ends.place() == 0);
    done += at;
    // Neither does a change that keeps no step go on, nor a far one before such.
    const bool stops = at < task.count && (steps.keeps >> at & 1) == 0;
    const bool before_stop = at + 1 < task.count && (steps.keeps >> at & steps.far >> at & 1) != 0;
    if (stops || before_stop) break;
    ends.advance(at);
  }
  writer = out;
  return done;
}

}  // namespace lamina::write::g4
