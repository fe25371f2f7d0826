#include "stages/formats/gcode/words.h"

#include <charconv>
#include <cmath>

namespace lamina::formats {
namespace {

bool is_blank(char c) { return c == ' ' || c == '\t'; }
bool is_digit(char c) { return c >= '0' && c <= '9'; }
bool is_letter(char c) { return (c >= 'A' && c <= 'Z') || (c >= 'a' && c <= 'z'); }

}  // namespace

std::string_view strip_comments(std::string_view line, std::string& scratch) {
  std::size_t end = 0;
  while (end < line.size() && line[end] != ';' && line[end] != '*' && line[end] != '(') ++end;
  if (end == line.size() || line[end] != '(') return line.substr(0, end);
  scratch.assign(line.substr(0, end));
  std::size_t depth = 0;
  for (const char c : line.substr(end)) {
    if (c == '(') {
      ++depth;
    } else if (c == ')') {
      depth -= depth > 0;
    } else if (depth > 0) {
      continue;
    } else if (c == ';' || c == '*') {
      break;
    } else {
      scratch += c;
    }
  }
  return scratch;
}

bool WordScanner::fail(bool no_number) {
  failed_ = true;
  no_number_ = no_number;
  return false;
}

bool WordScanner::read_number(bool blank) {
  std::string_view digits = left_;
  if (digits.starts_with('+')) digits.remove_prefix(1);
  const std::size_t sign = digits.starts_with('-') && digits.size() == left_.size() ? 1 : 0;
  if (digits.size() <= sign || (!is_digit(digits[sign]) && digits[sign] != '.')) return fail(true);
  const auto [end, code] = std::from_chars(digits.data(), digits.data() + digits.size(), value_, std::chars_format::fixed);
  if (code != std::errc() || !std::isfinite(value_)) return fail(true);
  if (blank) differences |= bit_of(Difference::kBlank);
  left_ = {end, static_cast<std::size_t>(left_.data() + left_.size() - end)};
  has_number_ = true;
  return true;
}

bool WordScanner::next() {
  const bool behind_number = has_number_;
  bool parted = word_.empty();
  while (!left_.empty() && is_blank(left_.front())) {
    left_.remove_prefix(1);
    parted = true;
  }
  word_ = left_;
  has_number_ = false;
  value_ = 0;
  if (left_.empty()) return false;
  const char letter = left_.front();
  if (!is_letter(letter)) return fail(false);
  letter_ = static_cast<char>(letter & ~0x20);
  if (letter != letter_) differences |= bit_of(Difference::kLowerCase);
  if (letter_ == 'E' && behind_number && !parted) differences |= bit_of(Difference::kExponent);
  left_.remove_prefix(1);
  if (left_.empty()) return true;
  if (!is_blank(left_.front())) return read_number(false);
  const std::string_view blanks = left_;
  while (!left_.empty() && is_blank(left_.front())) left_.remove_prefix(1);
  if (!left_.empty() && !is_letter(left_.front())) return read_number(true);
  left_ = blanks;
  return true;
}

}  // namespace lamina::formats
