#include "stages/support/text/terminal.h"

#include <fmt/format.h>
#include <sys/ioctl.h>
#include <unistd.h>

#include <algorithm>
#include <utility>

namespace lamina {

constexpr std::string_view kBegin = "\r\x1b[K";  // of the line, with nothing on it

bool is_terminal() { return ::isatty(STDERR_FILENO) == 1; }

int terminal_columns() {
  winsize size{};
  return ::ioctl(STDERR_FILENO, TIOCGWINSZ, &size) == 0 && size.ws_col > 0 ? size.ws_col : 80;
}

std::string progress_bar(double share, std::string_view what, int columns) {
  constexpr int kWidest = 40, kNarrowest = 10;
  const int width = std::min(kWidest, columns - static_cast<int>(what.size()) - 4);
  if (width < kNarrowest) return std::string(what);
  const int filled = static_cast<int>(share * width);
  return fmt::format("[{:#<{}}{:.<{}}] {}", "", filled, "", width - filled, what);
}

std::string StatusLine::draw(std::string_view line, int columns) {
  drawn_ = true;
  return fmt::format("{}{}", kBegin, line.substr(0, static_cast<std::size_t>(std::max(columns - 1, 1))));
}

std::string StatusLine::clear() { return std::string(std::exchange(drawn_, false) ? kBegin : ""); }

}  // namespace lamina
