#include "stages/replay/time/timer.h"

#include <fmt/format.h>

#include <string_view>

#include "stages/replay/bytes.h"
#include "stages/replay/printing.h"

namespace lamina::replay {
namespace {

/// Appends the lines but for those that load vectors, J<step> and R<count>.
void add_without_vectors(std::string_view lines, std::string& text) {
  while (!lines.empty()) {
    const std::size_t end = lines.find('\n');
    const std::string_view line = lines.substr(0, end == std::string_view::npos ? end : end + 1);
    if (line[0] != 'J' && line[0] != 'R') text += line;
    lines.remove_prefix(line.size());
  }
}

}  // namespace

void Timer::begin(const Layer& layer) {
  layer_ = layer;
  text_.clear();
  sweeps_.clear();
}

void Timer::read(std::span<const std::byte> lines) {
  const std::string_view text(reinterpret_cast<const char*>(lines.data()), lines.size());
  if (machine_->profile().dialect == "nuferbj") {
    add_without_vectors(text, text_);
  } else {
    text_ += text;
  }
}

void Timer::sweep(double across_mm, bool backward, std::int64_t first, std::int64_t last) {
  sweeps_.push_back({across_mm, backward, first, last});
}

Result<std::int64_t> Timer::end() {
  if (!text_.empty()) {
    auto taken = machine_->microseconds(text_, layer_);
    if (taken) return taken;
    return Error{Fault::kInternal, fmt::format("the machine would not take the program: {}; this is a fault of lamina, please "
                                               "report it",
                                               taken.error().message)};
  }
  Printing printing(*machine_, layer_, Purpose::kTime);
  Passes passes(printing);
  for (const Sweep& sweep : sweeps_) {
    passes.begin(sweep.across_mm, sweep.backward);
    passes.at(sweep.first);
    passes.at(sweep.last);
  }
  passes.end();
  if (Status status = printing.status(); !status) return Error{Fault::kInternal, status.error().message};
  return printing.finish().microseconds;
}

}  // namespace lamina::replay
