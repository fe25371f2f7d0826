#include "stages/replay/time/timer.h"

#include <fmt/format.h>

#include <algorithm>
#include <string_view>

#include "stages/replay/bytes.h"
#include "stages/replay/printing.h"

namespace lamina::replay {
namespace {

/// Whether a line loads vectors: J<step> and R<count> of nuferbj, SBR of the HP45 controller.
bool loads(std::string_view line, bool nuferbj) {
  return nuferbj ? line[0] == 'J' || line[0] == 'R' : line.starts_with("SBR ");
}

/// Appends the lines but for those that load vectors.
void add_without_vectors(std::string_view lines, bool nuferbj, std::string& text) {
  while (!lines.empty()) {
    const std::size_t end = lines.find('\n');
    const std::string_view line = lines.substr(0, end == std::string_view::npos ? end : end + 1);
    if (!loads(line, nuferbj)) text += line;
    lines.remove_prefix(line.size());
  }
}

}  // namespace

bool Timer::keeps_no_vectors(std::string_view dialect) {
  return dialect == "nuferbj" || dialect == "hp45" || dialect == "oasis";
}

void Timer::begin(const Layer& layer) {
  layer_ = layer;
  text_.clear();
  sweeps_.clear();
  added_microseconds_ = 0;
}

void Timer::read(std::span<const std::byte> lines) {
  const std::string_view text(reinterpret_cast<const char*>(lines.data()), lines.size());
  const std::string& dialect = machine_->profile().dialect;
  if (keeps_no_vectors(dialect)) {
    add_without_vectors(text, dialect == "nuferbj", text_);
  } else {
    text_ += text;
  }
}

void Timer::sweep(double across_mm, bool backward, std::int64_t first, std::int64_t last, bool added, std::uint32_t drops) {
  sweeps_.push_back({across_mm, backward, added, first, last, drops, text_.size()});
}

void Timer::maintenance(std::span<const std::byte> records) {
  text_.append(reinterpret_cast<const char*>(records.data()), records.size());
}

Result<Count> Timer::pass(bool all) const {
  Printing printing(*machine_, layer_, Purpose::kTime);
  Passes passes(printing);
  std::size_t maintenance = 0;
  const auto maintenance_until = [&](std::size_t end) {
    ByteReader reader(std::string_view(text_).substr(maintenance, end - maintenance), printing);
    take_maintenance_records(reader, printing, passes);
    if (!reader.done()) reader.fault("is no record of care");
    maintenance = end;
  };
  bool backward = false;
  for (const TimedSweep& sweep : sweeps_) {
    maintenance_until(sweep.maintenance);
    if (!all && sweep.added) continue;
    // Without the added ones directions alternate anew.
    const bool turned = !all && machine_->profile().motion.both_directions && sweep.backward != backward;
    passes.begin(sweep.across_mm, sweep.backward != turned);
    passes.at(turned ? sweep.last : sweep.first, sweep.drops);
    passes.at(turned ? sweep.first : sweep.last, sweep.drops);
    backward = !backward;
  }
  maintenance_until(text_.size());
  passes.end();
  if (Status status = printing.status(); !status) return Error{Fault::kInternal, status.error().message};
  return printing.finish();
}

Result<Count> Timer::end() {
  const std::string& dialect = machine_->profile().dialect;
  if (dialect != "raw" && dialect != "planes") {
    auto taken = machine_->timed(text_, layer_);
    if (taken) return taken;
    return Error{Fault::kInternal, fmt::format("the machine would not take the program: {}; this is a fault of lamina, please "
                                               "report it",
                                               taken.error().message)};
  }
  const Result<Count> whole = pass(true);
  if (!whole || std::ranges::none_of(sweeps_, &TimedSweep::added)) return whole;
  const Result<Count> without = pass(false);
  if (!without) return without;
  added_microseconds_ = whole->microseconds - without->microseconds;
  return whole;
}

}  // namespace lamina::replay
