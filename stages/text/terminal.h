// stages/text/terminal.h: the terminal at stderr, and a line on it that is drawn again and again.
//
// What is to be drawn is given as text; nothing is written here. cost  a system call for the terminal, none for the text
#pragma once

#include <string>
#include <string_view>

namespace lamina {

/// Whether stderr is a terminal.
bool is_terminal();
/// Columns of the terminal at stderr, or 80.
int terminal_columns();

/// "[####......] what" for a share from 0 to 1, at most 40 wide and one column less than there are; `what` alone where there
/// is no room for a bar.
std::string progress_bar(double share, std::string_view what, int columns);

/// The line that stands below all others.
class StatusLine {
 public:
  /// What draws a line in the place of the one before, cut to the columns.
  std::string draw(std::string_view line, int columns);
  /// What takes the line away, for another one that follows; "" if none is drawn.
  std::string clear();

 private:
  bool drawn_ = false;
};

}  // namespace lamina
