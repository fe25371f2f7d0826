// stages/load/stl_ascii.cpp: text STL.
//
// Tolerated, because programs write it: any case; LF, CRLF and CR, or all in one line; tabs; a byte order mark; the end of
// file of DOS (^Z); several solids; solids with names of any kind, or none; lines of remarks between facets; colours
// between facets, behind corners and before "endfacet"; signed numbers; normals that are no numbers (they are not used). Not
// tolerated, because it would lose facets in silence: words out of place within a facet, facets that do not have three corners,
// numbers with a decimal comma.
#include "stages/load/stl_ascii.h"

#include <fmt/core.h>
#include <tbb/parallel_for.h>

#include <array>
#include <cstring>
#include <vector>

#include "stages/load/messages.h"
#include "stages/load/text.h"

namespace lamina::load {
namespace {

constexpr std::size_t kWindowBytes = std::size_t{32} << 20, kBlock = std::size_t{1} << 20;

/// What a block of text holds. Blocks begin and end between facets.
struct TextBlock {
  Buffer<Triangle> triangles;
  Box bounds;
  std::uint64_t solids = 0, ends = 0, dropped = 0;
  const char* error_at = nullptr;
  std::string error;
};

class BlockParser {
 public:
  BlockParser(const char* begin, const char* end, const Snapper& snapper, bool drop_bad, TextBlock& block)
      : at_(begin), end_(end), snapper_(snapper), drop_bad_(drop_bad), block_(block) {}

  void parse() {
    while (block_.error_at == nullptr) {
      const std::string_view first = word();
      if (first.empty()) return;
      if (is_word(first, "facet")) {
        facet();
        continue;
      }
      for (const char* lost : {"outer", "vertex", "endloop", "endfacet"})
        if (is_word(first, lost)) return fail(first, fmt::format("'{}' outside of a facet", lost));
      if (is_word(first, "solid")) ++block_.solids;
      if (is_word(first, "endsolid")) ++block_.ends;
      skip_line();
    }
  }

 private:
  /// To the end of the line, or to a facet that begins in it: some files are one line.
  void skip_line() {
    while (at_ != end_ && !is_line_end(*at_)) {
      if (is_space(*at_)) {
        ++at_;
        continue;
      }
      const char* const begin = at_;
      const std::string_view found = word_of_line();
      if (!is_word(found, "facet") || !facet_follows()) continue;
      at_ = begin;
      return;
    }
  }

  /// Whether the line goes on as a facet does behind its first word.
  bool facet_follows() {
    const char* const here = at_;
    bool follows = is_word(word_of_line(), "normal");
    for (int number = 0; number < 3; ++number) word_of_line();
    follows = follows && is_word(word_of_line(), "outer");
    at_ = here;
    return follows;
  }

  /// The next word of the line; empty at its end.
  std::string_view word_of_line() {
    while (at_ != end_ && is_space(*at_) && !is_line_end(*at_)) ++at_;
    const char* const begin = at_;
    while (at_ != end_ && !is_space(*at_)) ++at_;
    return {begin, static_cast<std::size_t>(at_ - begin)};
  }

  std::string_view word() {
    while (at_ != end_ && is_space(*at_)) ++at_;
    const char* const begin = at_;
    while (at_ != end_ && !is_space(*at_)) ++at_;
    return {begin, static_cast<std::size_t>(at_ - begin)};
  }

  void fail(std::string_view at, std::string message) {
    block_.error_at = at.empty() ? end_ : at.data();
    block_.error = at.empty() ? "is cut short: the text ends within a facet; copy or export it again" : std::move(message);
  }

  bool expect(std::string_view lower_case) {
    const std::string_view found = word();
    if (is_word(found, lower_case)) return true;
    fail(found, fmt::format("{} where '{}' belongs", quoted(found), lower_case));
    return false;
  }

  bool outer_loop() {
    // "normal" and its numbers come first; what they are does not matter.
    for (int words = 0; words < 6; ++words) {
      const std::string_view found = word();
      if (is_word(found, "outer")) return expect("loop");
      if (found.empty() || is_word(found, "vertex") || is_word(found, "endfacet") || is_word(found, "facet")) {
        fail(found, fmt::format("{} where 'outer loop' belongs", quoted(found)));
        return false;
      }
    }
    fail({at_ - 1, 1}, "'outer loop' is missing");
    return false;
  }

  /// Whether there is a corner; `snapped` says whether it could be used.
  bool corner(Point3& out, Snapped& snapped) {
    if (!expect("vertex")) return false;
    std::array<double, 3> position;
    std::string_view found;
    for (double& number : position) {
      found = word();
      if (!parse_number(found, number)) {
        fail(found, fmt::format("{} is not a number", quoted(found)));
        return false;
      }
    }
    pass_numbers();
    snapped = snapper_.snap(position[0], position[1], position[2], out);
    if (snapped == Snapped::kYes || (snapped == Snapped::kNotFinite && drop_bad_)) return true;
    fail(found, what_is_wrong(snapped));
    return false;
  }

  /// Numbers behind a corner's three: a colour.
  void pass_numbers() {
    for (double ignored = 0; at_ != end_ && !is_line_end(*at_);) {
      const char* const begin = at_;
      const std::string_view found = word_of_line();
      if (!found.empty() && parse_number(found, ignored)) continue;
      at_ = begin;
      return;
    }
  }

  /// Lines of words that the format does not have, such as colours, behind the loop.
  bool end_of_facet() {
    if (!expect("endloop")) return false;
    for (std::string_view found = word();; found = word()) {
      if (is_word(found, "endfacet")) return true;
      const bool lost = found.empty() || is_word(found, "vertex") || is_word(found, "facet") || is_word(found, "outer");
      if (!lost) continue;
      fail(found, fmt::format("{} where 'endfacet' belongs", quoted(found)));
      return false;
    }
  }

  void facet() {
    if (!outer_loop()) return;
    std::array<Point3, 3> corners{};
    bool finite = true;
    for (Point3& point : corners) {
      Snapped snapped = Snapped::kYes;
      if (!corner(point, snapped)) return;
      finite = finite && snapped == Snapped::kYes;
    }
    if (!end_of_facet()) return;
    if (!finite) {
      ++block_.dropped;
      return;
    }
    if (snapper_.mirrors()) std::swap(corners[1], corners[2]);
    for (const Point3& point : corners) block_.bounds.add(point);
    block_.triangles.push_back({corners[0], corners[1], corners[2]});
  }

  const char* at_;
  const char* const end_;
  const Snapper& snapper_;
  const bool drop_bad_;
  TextBlock& block_;
};

/// Bytes up to behind the last "endfacet" that is the first word of its line (a solid may be called that) or has another
/// facet behind it; 0 if none.
std::size_t behind_last_facet(const char* begin, const char* end) {
  constexpr std::string_view kWord = "endfacet";
  for (const char* at = end; at - begin >= static_cast<std::ptrdiff_t>(kWord.size()) + 1;) {
    --at;
    if ((*at | 0x20) != 't') continue;
    const char* const first = at + 1 - kWord.size();
    if (first < begin || !is_word({first, kWord.size()}, kWord)) continue;
    if (at + 1 != end && !is_space(at[1])) continue;
    const char* before = first;
    while (before != begin && is_space(before[-1]) && !is_line_end(before[-1])) --before;
    if (before == begin || is_line_end(before[-1])) return static_cast<std::size_t>(at + 1 - begin);
    // Within a line, a facet has to follow.
    const char* behind = at + 1;
    while (behind != end && is_space(*behind)) ++behind;
    constexpr std::string_view kNext = "facet normal ";
    if (end - behind > static_cast<std::ptrdiff_t>(kNext.size()) && is_word({behind, kNext.size()}, kNext))
      return static_cast<std::size_t>(at + 1 - begin);
  }
  return 0;
}

}  // namespace

Result<Facets> read_ascii_stl(const Source& source, const Snapper& snapper, const LoadOptions& options) {
  Facets facets;
  std::uint64_t solids = 0, ends = 0, dropped = 0;
  const auto read_window = [&](const char* begin, const char* end, std::uint64_t offset) -> Status {
    std::vector<const char*> cuts{begin};
    while (end - cuts.back() > static_cast<std::ptrdiff_t>(kBlock)) {
      const std::size_t usable = behind_last_facet(cuts.back(), cuts.back() + kBlock);
      if (usable == 0) break;
      cuts.push_back(cuts.back() + usable);
    }
    cuts.push_back(end);
    std::vector<TextBlock> blocks(cuts.size() - 1);
    tbb::parallel_for(std::size_t{0}, blocks.size(),
                      [&](std::size_t i) { BlockParser(cuts[i], cuts[i + 1], snapper, options.drop_bad, blocks[i]).parse(); });
    for (TextBlock& block : blocks) {
      if (block.error_at != nullptr)
        return source.error(fmt::format(
            "line {}: {}", line_of(source, offset + static_cast<std::uint64_t>(block.error_at - begin)), block.error));
      if (facets.triangles.size() + block.triangles.size() > options.triangle_limit)
        return source.error(fmt::format("more than the limit of {} facets", options.triangle_limit));
      facets.triangles.insert(facets.triangles.end(), block.triangles.begin(), block.triangles.end());
      facets.bounds.add(block.bounds);
      solids += block.solids, ends += block.ends, dropped += block.dropped;
      block.triangles = {};
    }
    return {};
  };
  if (const Status read = for_each_window(source, kWindowBytes, behind_last_facet, read_window); !read) return read.error();
  if (facets.triangles.empty() && dropped == 0) return source.error("holds no facets");
  if (dropped > 0)
    facets.notes.push_back(
        {true, fmt::format("{} facet{} with coordinates that are not finite dropped", dropped, dropped == 1 ? "" : "s")});
  if (solids > 1) facets.notes.push_back({false, fmt::format("{} solids are planned as one part", solids)});
  if (ends < solids)
    facets.warning =
        ReadWarning{"the last solid has no 'endsolid', but its facets close",
                    "is cut short: the last solid has no 'endsolid' and its facets do not close; copy or export it again"};
  return facets;
}

}  // namespace lamina::load
