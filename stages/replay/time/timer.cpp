#include "stages/replay/time/timer.h"

#include <fmt/format.h>

#include <string_view>

#include "stages/replay/bytes.h"
#include "stages/replay/care/records.h"
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

void Timer::sweep(double across_mm, bool backward, std::int64_t first, std::int64_t last) {
  sweeps_.push_back({across_mm, backward, first, last, text_.size()});
}

void Timer::care(std::span<const std::byte> records) {
  text_.append(reinterpret_cast<const char*>(records.data()), records.size());
}

Result<Count> Timer::end() {
  const std::string& dialect = machine_->profile().dialect;
  const bool head_alone = dialect == "raw" || dialect == "planes";
  auto taken = head_alone ? of_sweeps() : machine_->timed(text_, layer_);
  if (taken) return taken;
  return Error{Fault::kInternal, fmt::format("the machine would not take the program: {}; this is a fault of lamina, please "
                                             "report it",
                                             taken.error().message)};
}

Result<Count> Timer::of_sweeps() const {
  Printing printing(*machine_, layer_, Purpose::kTime);
  Passes passes(printing);
  std::size_t at = 0;
  const auto care_until = [&](std::size_t end) {
    ByteReader reader(std::string_view(text_).substr(at, end - at), printing);
    take_care_records(reader, printing, passes);
    if (!reader.done()) reader.fault("is no record of care");
    at = end;
  };
  for (const Sweep& sweep : sweeps_) {
    care_until(sweep.care);
    passes.begin(sweep.across_mm, sweep.backward);
    passes.at(sweep.first);
    passes.at(sweep.last);
  }
  care_until(text_.size());
  passes.end();
  if (Status status = printing.status(); !status) return status.error();
  return printing.finish();
}

}  // namespace lamina::replay
