#include "pipeline/cli/progress_bar.h"

#include <fmt/format.h>

#include <algorithm>

#include "pipeline/cli/console.h"
#include "pipeline/text/readable.h"

namespace lamina::pipeline {
namespace {

using std::chrono::milliseconds;
using Stage = ProgressEvent::Stage;

}  // namespace

std::string Progress::text(const ProgressEvent& event, std::uint32_t done_before, double seconds) {
  std::string text = fmt::format("{}/{} layers", event.done, event.total);
  const double planned = event.done - done_before;
  if (planned > 0 && seconds > 0) {
    const double rate = planned / seconds;
    text += fmt::format(", {:.{}f} layers/s", rate, rate < 100 ? 1 : 0);
    if (event.done < event.total) text += fmt::format(", {} left", readable_seconds((event.total - event.done) / rate));
  }
  return text;
}

void Progress::draw(const std::string& what, double share) {
  constexpr int kWidest = 40;
  const int room = terminal_columns() - static_cast<int>(what.size()) - 4;
  const int width = std::min(kWidest, room);
  std::string line = "\r\x1b[K";
  if (width >= 10) {
    const int filled = static_cast<int>(share * width);
    line += fmt::format("[{}{}] ", std::string(static_cast<std::size_t>(filled), '#'),
                        std::string(static_cast<std::size_t>(width - filled), '.'));
  }
  line += what.substr(0, static_cast<std::size_t>(std::max(terminal_columns() - 1, 1)));
  say_text(line);
  drawn_ = true;
}

void Progress::operator()(const ProgressEvent& event) {
  if (style_ == Style::kSilent) return;
  const Clock::time_point now = Clock::now();
  if (event.stage != Stage::kLayers) {
    if (style_ == Style::kBar) draw(event.stage == Stage::kLoading ? "loading parts" : "indexing", 0);
    return;
  }
  if (!counting_) {
    counting_ = true;
    started_ = told_ = now;
    done_before_ = event.done;
    tenths_told_ = event.total > 0 ? static_cast<std::uint32_t>(10ull * event.done / event.total) : 0;
    return;
  }
  const double seconds = std::chrono::duration<double>(now - started_).count();
  if (style_ == Style::kBar) {
    if (now - told_ < milliseconds(100)) return;
    told_ = now;
    draw(text(event, done_before_, seconds), event.total > 0 ? static_cast<double>(event.done) / event.total : 1);
    return;
  }
  const auto tenths = event.total > 0 ? static_cast<std::uint32_t>(10ull * event.done / event.total) : 10;
  const bool due = (tenths > tenths_told_ && now - told_ >= milliseconds(1000)) || now - told_ >= milliseconds(5000);
  if (!due) return;
  told_ = now;
  tenths_told_ = tenths;
  say(text(event, done_before_, seconds));
}

void Progress::clear() {
  if (drawn_) say_text("\r\x1b[K");
  drawn_ = false;
}

}  // namespace lamina::pipeline
