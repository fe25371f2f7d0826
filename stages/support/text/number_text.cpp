#include "stages/support/text/number_text.h"

#include <fmt/format.h>

#include <charconv>
#include <cmath>
#include <system_error>

namespace lamina {
namespace {

bool parse(std::string_view text, double& value) {
  const char* end = text.data() + text.size();
  double parsed = 0;
  const auto [stop, error] = std::from_chars(text.data(), end, parsed);
  if (error != std::errc() || stop != end || !std::isfinite(parsed)) return false;
  value = parsed + 0.0;  // -0 is 0
  return true;
}

std::string quoted(std::string_view text) { return fmt::format("'{}'", text.substr(0, 60)); }

}  // namespace

std::string number_text(double value) { return fmt::format("{}", value + 0.0); }

std::vector<std::string_view> split(std::string_view text, std::string_view separators) {
  std::vector<std::string_view> pieces;
  while (true) {
    const std::size_t at = text.find_first_of(separators);
    pieces.push_back(text.substr(0, at));
    if (at == std::string_view::npos) return pieces;
    text.remove_prefix(at + 1);
  }
}

std::string_view trimmed(std::string_view text) {
  while (text.starts_with(' ')) text.remove_prefix(1);
  while (text.ends_with(' ')) text.remove_suffix(1);
  return text;
}

std::string comma_hint(std::string_view text) {
  constexpr std::string_view kDecimals = "0123456789";
  const std::size_t comma = text.find(',');
  if (comma == std::string_view::npos || comma == 0 || text.find(',', comma + 1) != std::string_view::npos) return {};
  const std::string_view before = text.substr(0, comma), after = text.substr(comma + 1);
  const std::string_view whole = before.substr(before.find_last_not_of(kDecimals) + 1);
  const std::string_view fraction = after.substr(0, after.find_first_not_of(kDecimals));
  if (whole.empty() || fraction.empty()) return {};
  return fmt::format("; decimal numbers have a point, as {}.{}", whole, fraction);
}

std::string with_comma_hint(std::string wrong, std::string_view text) {
  const std::string hint = wrong.empty() ? std::string() : comma_hint(text);
  return wrong.find(hint) == std::string::npos ? wrong + hint : wrong;
}

std::string read_number(std::string_view text, double low, double high, std::string_view unit, double& value) {
  double parsed = 0;
  if (!parse(text, parsed)) {
    return fmt::format("{} is not a finite number; give one from {} to {}{}{}", quoted(text), low, high, unit,
                       comma_hint(text));
  }
  if (parsed < low || parsed > high) {
    return fmt::format("{} is out of range; give a number from {} to {}{}", text, low, high, unit);
  }
  value = parsed;
  return {};
}

std::string read_whole(std::string_view text, std::int64_t low, std::int64_t high, std::int64_t& value) {
  double parsed = 0;
  if (!parse(text, parsed) || parsed != std::floor(parsed)) {
    return fmt::format("{} is not a whole number; give one from {} to {}{}", quoted(text), low, high, comma_hint(text));
  }
  if (parsed < static_cast<double>(low) || parsed > static_cast<double>(high)) {
    return fmt::format("{} is out of range; give a whole number from {} to {}", text, low, high);
  }
  value = static_cast<std::int64_t>(parsed);
  return {};
}

std::string read_switch(std::string_view text, bool& value) {
  if (text != "true" && text != "false") return fmt::format("{} is neither true nor false", quoted(text));
  value = text == "true";
  return {};
}

std::string read_bytes(std::string_view text, std::uint64_t& bytes) {
  std::string_view number = text;
  for (const std::string_view ending : {"iB", "B"}) {
    if (number.ends_with(ending)) {
      number.remove_suffix(ending.size());
      break;
    }
  }
  double unit = 1;
  if (!number.empty()) {
    const std::string_view letters = "KMGkmg";
    const std::size_t letter = letters.find(number.back());
    if (letter != std::string_view::npos) {
      unit = std::ldexp(1.0, 10 * static_cast<int>(letter % 3 + 1));
      number.remove_suffix(1);
    }
  }
  double parsed = 0;
  if (!parse(number, parsed) || !(parsed * unit >= 1) || parsed * unit > std::ldexp(1.0, 50)) {
    return fmt::format("{} is not a size from 1 byte to 1024 tebibytes; write it as 256M, 1G or in bytes{}", quoted(text),
                       comma_hint(text));
  }
  bytes = static_cast<std::uint64_t>(parsed * unit);
  return {};
}

std::string read_layer_range(std::string_view text, std::array<std::uint32_t, 2>& range) {
  const auto pieces = split(text, ":");
  std::int64_t first = 0, last = UINT32_MAX;
  const bool readable = pieces.size() == 2 && (pieces[0].empty() || read_whole(pieces[0], 0, UINT32_MAX, first).empty()) &&
                        (pieces[1].empty() || read_whole(pieces[1], 0, UINT32_MAX, last).empty());
  if (!readable) {
    return fmt::format("{} is no range of layers; write first:last, counted from 0, last not included, as in 0:100",
                       quoted(text));
  }
  if (first >= last) return fmt::format("{} holds no layer; last has to be greater than first", quoted(text));
  range = {static_cast<std::uint32_t>(first), static_cast<std::uint32_t>(last)};
  return {};
}

std::string read_shard(std::string_view text, std::array<std::uint32_t, 2>& shard) {
  const auto pieces = split(text, "/");
  std::int64_t index = 0, count = 0;
  if (pieces.size() != 2 || !read_whole(pieces[0], 1, 1'000'000, index).empty() ||
      !read_whole(pieces[1], 1, 1'000'000, count).empty() || index > count) {
    return fmt::format("{} is no shard; write i/n with i from 1 to n, as in 1/4 to 4/4", quoted(text));
  }
  shard = {static_cast<std::uint32_t>(index - 1), static_cast<std::uint32_t>(count)};
  return {};
}

std::string mm_text(double millimetres) {
  const double rounded =
      static_cast<double>(static_cast<std::int64_t>(millimetres * 1e4 + (millimetres < 0 ? -0.5 : 0.5))) / 1e4;
  return fmt::format("{:.4f}", rounded == 0 ? 0.0 : rounded);
}

std::string plain_text(double value, int digits) {
  std::string text = fmt::format("{:.{}f}", value, digits);
  if (digits == 0) return text;
  text.erase(text.find_last_not_of('0') + 1);
  if (text.back() == '.') text.pop_back();
  return text;
}

std::string feed_text(double mm_s) {
  return mm_s * 60 < 1 ? fmt::format("{:.2f}", mm_s * 60) : fmt::format("{:.0f}", mm_s * 60);
}

char separator_of(std::string_view header) {
  return header.find('\t') != std::string_view::npos ? '\t' : header.find(';') != std::string_view::npos ? ';' : ',';
}

std::vector<std::string> cells_of(std::string_view line, char separator) {
  if (line.ends_with('\r')) line.remove_suffix(1);
  std::vector<std::string> cells;
  for (std::string_view cell : split(line, std::string_view(&separator, 1))) {
    while (!cell.empty() && (cell.front() == ' ' || cell.front() == '"')) cell.remove_prefix(1);
    while (!cell.empty() && (cell.back() == ' ' || cell.back() == '"')) cell.remove_suffix(1);
    cells.emplace_back(cell);
  }
  return cells;
}

}  // namespace lamina
