#include "stages/support/text/shell_words.h"

#include <fmt/format.h>

namespace lamina {

Result<std::vector<std::string>> split_words(std::string_view line) {
  std::vector<std::string> words;
  std::string word;
  bool within = false;
  char quote = 0;
  for (std::size_t i = 0; i < line.size(); ++i) {
    const char c = line[i];
    const bool blank = c == ' ' || c == '\t' || c == '\r' || c == '\n';
    if (quote != 0) {
      if (c == quote) {
        quote = 0;
      } else if (c == '\\' && quote == '"' && i + 1 < line.size()) {
        word += line[++i];
      } else {
        word += c;
      }
    } else if (blank) {
      if (within) words.push_back(std::move(word));
      word.clear();
      within = false;
    } else if (c == '#' && !within) {
      break;
    } else {
      within = true;
      if (c == '\'' || c == '"') {
        quote = c;
      } else if (c == '\\' && i + 1 < line.size()) {
        word += line[++i];
      } else {
        word += c;
      }
    }
  }
  if (quote != 0) return Error{Fault::kUsage, fmt::format("a {} is not closed", quote)};
  if (within) words.push_back(std::move(word));
  return words;
}

}  // namespace lamina
