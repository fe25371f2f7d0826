#include "stages/support/text/readable.h"

#include <fmt/format.h>

#include <algorithm>
#include <vector>

namespace lamina {
std::string readable_bytes(std::uint64_t bytes) {
  const double value = static_cast<double>(bytes);
  if (bytes < 1000) return fmt::format("{} B", bytes);
  if (bytes < 1000'000) return fmt::format("{:.1f} kB", value / 1e3);
  if (bytes < 1000'000'000) return fmt::format("{:.1f} MB", value / 1e6);
  return fmt::format("{:.2f} GB", value / 1e9);
}

std::string readable_seconds(double seconds) {
  if (seconds < 1) return fmt::format("{:.3f} s", seconds);
  if (seconds < 60) return fmt::format("{:.1f} s", seconds);
  const auto whole = static_cast<std::uint64_t>(std::min(seconds, 1e15));
  if (whole < 3600) return fmt::format("{} min {:02} s", whole / 60, whole % 60);
  return fmt::format("{} h {:02} min", whole / 3600, whole / 60 % 60);
}

std::string readable_count(std::uint64_t count) {
  std::string text = fmt::format("{}", count);
  for (std::size_t at = text.size(); at > 3;) text.insert(at -= 3, 1, ' ');
  return text;
}

std::string one_line(std::string_view text) {
  std::string out;
  for (const char c : text) {
    const bool control = static_cast<std::uint8_t>(c) < 0x20 || c == 0x7f;
    if (!control) {
      out += c;
    } else if (!out.empty() && out.back() != ' ') {
      out += ' ';
    }
  }
  while (!out.empty() && out.back() == ' ') out.pop_back();
  return out;
}

std::string lower_case(std::string_view text) {
  std::string out(text);
  std::ranges::transform(out, out.begin(), [](char c) { return c >= 'A' && c <= 'Z' ? static_cast<char>(c - 'A' + 'a') : c; });
  return out;
}

namespace {

// Levenshtein's distance.
std::size_t edits(std::string_view a, std::string_view b) {
  std::vector<std::size_t> row(b.size() + 1);
  for (std::size_t j = 0; j <= b.size(); ++j) row[j] = j;
  for (std::size_t i = 0; i < a.size(); ++i) {
    std::size_t diagonal = row[0];
    row[0] = i + 1;
    for (std::size_t j = 0; j < b.size(); ++j) {
      const std::size_t replaced = diagonal + (a[i] == b[j] ? 0 : 1);
      diagonal = row[j + 1];
      row[j + 1] = std::min({replaced, row[j] + 1, row[j + 1] + 1});
    }
  }
  return row.back();
}

}  // namespace

std::string suggest(std::string_view mistyped, std::span<const std::string_view> known) {
  if (mistyped.size() > 100) return {};
  std::string_view nearest;
  // The dashes of an option say nothing.
  const std::size_t letters = mistyped.size() - std::min(mistyped.find_first_not_of('-'), mistyped.size());
  std::size_t distance = mistyped.size(), between_equals = 0;
  for (const std::string_view name : known) {
    // Half a name counts as near: --lay, thickness. Of two names that hold it, the shorter one is nearer.
    const bool half = mistyped.size() >= 4 && name.find(mistyped) != std::string_view::npos;
    const std::size_t all_edits = edits(mistyped, name), edits_away = half ? 1 : all_edits;
    // A third of the letters may be wrong; a short word has one too few or too many, or two swapped.
    const std::size_t limit = std::max<std::size_t>(letters / 3, mistyped.size() == name.size() ? 2 : 1);
    if (edits_away >= name.size() || edits_away > std::min(limit, distance)) continue;
    if (edits_away == distance && !nearest.empty() && all_edits >= between_equals) continue;
    distance = edits_away;
    between_equals = all_edits;
    nearest = name;
  }
  return nearest.empty() ? std::string() : fmt::format("; did you mean '{}'?", nearest);
}

}  // namespace lamina
