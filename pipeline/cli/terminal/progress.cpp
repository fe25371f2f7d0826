#include "pipeline/cli/terminal/progress.h"

#include <fmt/format.h>

#include "stages/support/text/readable.h"

namespace lamina::pipeline {

std::string Progress::rate(std::uint32_t done, std::uint32_t total, std::uint32_t before, double seconds,
                           std::string_view unit) {
  std::string text = fmt::format("{}/{} {}", done, total, unit);
  const double planned = done - before;
  if (planned > 0 && seconds > 0) {
    const double rate = planned / seconds;
    text += fmt::format(", {:.{}f} {}/s", rate, rate < 100 ? 1 : 0, unit);
    if (done < total) text += fmt::format(", {} left", readable_seconds((total - done) / rate));
  }
  return text;
}

std::string Progress::draw(std::string_view what, double share) {
  const int columns = terminal_columns();
  return line_.draw(progress_bar(share, what, columns), columns);
}

std::string Progress::begin(std::string_view what) { return style_ == Style::kBar ? draw(what, 0) : ""; }

std::string Progress::report(std::uint32_t done, std::uint32_t total, std::string_view unit) {
  using namespace std::chrono_literals;
  if (style_ == Style::kSilent) return {};
  const Clock::time_point now = Clock::now();
  const bool bar = style_ == Style::kBar;
  const auto tenths = total > 0 ? static_cast<std::uint32_t>(10ull * done / total) : 10;
  if (!counting_) {
    counting_ = true;
    started_ = reports_ = now;
    before_ = done;
    tenths_reported_ = total > 0 ? tenths : 0;
    return {};
  }
  const auto silent = now - reports_;
  if (bar ? silent < 100ms : silent < 5s && (tenths <= tenths_reported_ || silent < 1s)) return {};
  reports_ = now;
  tenths_reported_ = tenths;
  const std::string text = rate(done, total, before_, std::chrono::duration<double>(now - started_).count(), unit);
  return bar ? draw(text, total > 0 ? static_cast<double>(done) / total : 1) : text + "\n";
}

}  // namespace lamina::pipeline
