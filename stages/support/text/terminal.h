// stages/support/text/terminal.h: the terminal at stderr, and a status line on it.
//
// Functions return the text to draw and write nothing. cost  a system call for the terminal, none for the text
#pragma once

#include <string>
#include <string_view>

namespace lamina {

/// Whether stderr is a terminal.
bool is_terminal();
/// Columns of the terminal at stderr, or 80.
int terminal_columns();

/// "[####......] what" for a fraction from 0 to 1. The bar is at most 40 wide, the line one column narrower than the
/// terminal; only `what` if the bar does not fit.
std::string progress_bar(double share, std::string_view what, int columns);

/// The status line below all other output.
class StatusLine {
 public:
  /// The text that replaces the previous line, truncated to the columns.
  std::string draw(std::string_view line, int columns);
  /// The text that erases the line before other output; "" if none is drawn.
  std::string clear();

 private:
  bool drawn_ = false;
};

}  // namespace lamina
