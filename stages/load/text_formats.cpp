// stages/load/text_formats.cpp: Wavefront OBJ and text STL.
//
// OBJ: understood are v (colours or a weight behind the position are left out) and f with corners as v, v/t, v//n or v/t/n,
// counted from 1 or backwards from -1; polygons become fans from their first corner; lines end with LF, CRLF or CR and
// continue after a backslash, in every statement; a note names the first vertex or face that this makes part of another line.
// Vertices that no face uses may be anything. Groups, materials, normals, lines and points do not matter to a solid. Numbers
// are read in double precision: other readers of this format keep floats.
//
// STL: tolerated, because programs write it: any case; LF, CRLF and CR, or all in one line; tabs; a byte order mark; the end of
// file of DOS (^Z); several solids; solids with names of any kind, or none; lines of remarks between facets; colours
// between facets, behind corners and before "endfacet"; signed numbers; normals that are no numbers (they are not used). Not
// tolerated, because it would lose facets in silence: words out of place within a facet, facets that do not have three corners,
// numbers with a decimal comma.
#include "stages/load/text_formats.h"

#include <fmt/core.h>
#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include <array>
#include <cstring>
#include <vector>

#include "stages/load/text.h"

namespace lamina::load {
namespace {

constexpr std::size_t kWindow = std::size_t{8} << 20;

/// Bytes of whole lines, in the sense of the format: an end of line behind a backslash does not count.
std::size_t behind_last_line(const char* begin, const char* end) {
  for (const char* at = end; at != begin;) {
    if (!is_line_end(*--at)) continue;
    const char* before = at;
    if (*at == '\n' && before != begin && before[-1] == '\r') --before;
    if (before == begin || before[-1] != '\\') return static_cast<std::size_t>(at + 1 - begin);
  }
  return 0;
}

class ObjParser {
 public:
  ObjParser(const Source& source, const Snapper& snapper, const LoadOptions& options)
      : source_(source), snapper_(snapper), options_(options) {}

  Status parse(const char* begin, const char* end, std::uint64_t offset) {
    at_ = begin_ = begin, end_ = end, offset_ = offset;
    while (at_ != end_) {
      const std::string_view kind = word();
      Status read;
      if (kind == "v") {
        read = vertex();
      } else if (kind == "f") {
        read = face();
      } else if (!kind.empty() && kind.front() == '#') {
        at_ = kind.data();
      } else if (!kind.empty()) {
        remark_on(kind);
      }
      if (!read) return read;
      skip_line();
    }
    return {};
  }

  Result<Facets> finish() {
    for (const Forward& forward : forward_)
      if (forward.index >= vertices_.size())
        return fail(forward.offset, fmt::format("corner {} of {} vertices", forward.index + 1, vertices_.size()));
    forward_ = {};
    Facets facets;
    const std::size_t count = corners_.size();
    facets.triangles.resize(count);
    const bool mirrors = snapper_.mirrors();
    tbb::parallel_for(tbb::blocked_range<std::size_t>(0, count, 1 << 14), [&](const auto& range) {
      for (std::size_t i = range.begin(); i != range.end(); ++i) {
        const auto [a, b, c] = corners_[i];
        facets.triangles[i] = {vertices_[a], vertices_[mirrors ? c : b], vertices_[mirrors ? b : c]};
      }
    });
    if (!bad_.empty())
      if (const Status dropped = drop_bad_facets(facets); !dropped) return dropped.error();
    for (const Triangle& t : facets.triangles) facets.bounds.add(t.a), facets.bounds.add(t.b), facets.bounds.add(t.c);
    if (count == 0) return source_.error("holds no faces");
    if (short_faces_ > 0)
      facets.notes.push_back({false, fmt::format("{} faces with less than three corners are left out", short_faces_)});
    if (remarks_ > 0)
      facets.notes.push_back({false, fmt::format("{} lines are not understood and left out, the first is line {}", remarks_,
                                                 line_of(source_, remark_offset_))});
    if (swallowed_ > 0)
      facets.notes.push_back(
          {true,
           fmt::format("line {} begins as a vertex or a face but continues the line above, which ends in a backslash{}: not "
                       "read; delete the backslash if the line is meant",
                       line_of(source_, swallowed_offset_),
                       swallowed_ > 1 ? fmt::format(", and so do {} more", swallowed_ - 1) : "")});
    return facets;
  }

 private:
  struct Forward {
    std::uint64_t index, offset;
  };

  /// A vertex without a position, and where it is in the file.
  struct BadVertex {
    std::uint32_t index;
    Snapped how;
    std::uint64_t offset;
  };

  /// Whether the line continues after a backslash here, and how many bytes that is. Windows end at lines, so that a backslash
  /// at the end of one is the last byte of the file.
  bool continues() const { return *at_ == '\\' && (at_ + 1 == end_ || is_line_end(at_[1])); }
  std::ptrdiff_t continuation() const {
    return at_ + 1 == end_ ? 1 : at_[1] == '\r' && at_ + 2 != end_ && at_[2] == '\n' ? 3 : 2;
  }

  /// The next word of the line; empty at its end.
  std::string_view word() {
    while (at_ != end_) {
      if (continues()) {
        at_ += continuation();
      } else if (is_space(*at_) && !is_line_end(*at_)) {
        ++at_;
      } else {
        break;
      }
    }
    const char* const begin = at_;
    while (at_ != end_ && !is_space(*at_) && !continues()) ++at_;
    return {begin, static_cast<std::size_t>(at_ - begin)};
  }

  /// Whether the physical line from here on begins as a vertex or a face does.
  bool begins_element() const {
    const char* p = at_;
    const auto blank = [&] { return p != end_ && (*p == ' ' || *p == '\t'); };
    while (blank()) ++p;
    if (p == end_ || (*p != 'v' && *p != 'f')) return false;
    if (++p; !blank()) return false;
    while (blank()) ++p;
    return p != end_ && std::string_view("0123456789+-.").find(*p) != std::string_view::npos;
  }

  /// What a backslash joins to the line is part of it, even if it begins as a vertex or a face does; only comments, such as
  /// "# C:\parts\", end with their line.
  void skip_line() {
    for (bool comment = false; at_ != end_ && !is_line_end(*at_);) {
      comment = comment || (*at_ == '#' && (at_ == begin_ || is_space(at_[-1])));
      if (comment || !continues()) {
        ++at_;
        continue;
      }
      at_ += continuation();
      if (begins_element() && swallowed_++ == 0) swallowed_offset_ = offset_of(at_);
    }
    if (at_ != end_) ++at_;
  }

  std::uint64_t offset_of(const char* at) const { return offset_ + static_cast<std::uint64_t>(at - begin_); }
  Error fail(std::uint64_t offset, const std::string& message) const {
    return source_.error(fmt::format("line {}: {}", line_of(source_, offset), message));
  }
  /// An error at the word that was read last.
  Error fail(const std::string& message) const { return fail(offset_of(at_ == begin_ ? at_ : at_ - 1), message); }

  Status vertex() {
    std::array<double, 3> position;
    for (double& number : position) {
      const std::string_view found = word();
      if (found.empty()) return fail("a vertex has three numbers");
      if (!parse_number(found, number)) return fail(not_a_number(found));
    }
    Point3 point{};
    const Snapped snapped = snapper_.snap(position[0], position[1], position[2], point);
    if (vertices_.size() == UINT32_MAX) return fail("more than 4294967295 vertices");
    if (snapped != Snapped::kYes)
      bad_.push_back({static_cast<std::uint32_t>(vertices_.size()), snapped, offset_of(at_ == begin_ ? at_ : at_ - 1)});
    vertices_.push_back(point);
    return {};
  }

  /// A corner as an index from 0.
  Result<std::uint32_t> corner(std::string_view found) {
    const std::string_view number = found.substr(0, found.find('/'));
    std::int64_t index = 0;
    const auto [end, status] = std::from_chars(number.data(), number.data() + number.size(), index);
    if (status != std::errc{} || end != number.data() + number.size() || index == 0)
      return fail(fmt::format("{} is not the number of a vertex; they count from 1", quoted(found)));
    const auto so_far = static_cast<std::int64_t>(vertices_.size());
    if (index < -so_far || index > std::int64_t{UINT32_MAX})
      return fail(fmt::format("corner {} of {} vertices", index, so_far));
    if (index > so_far) forward_.push_back({static_cast<std::uint64_t>(index - 1), offset_of(found.data())});
    return static_cast<std::uint32_t>(index < 0 ? so_far + index : index - 1);
  }

  Status face() {
    std::array<std::uint32_t, 3> fan{};
    std::size_t count = 0;
    for (std::string_view found = word(); !found.empty(); found = word()) {
      if (found.front() == '#') {
        at_ = found.data();
        break;
      }
      const Result<std::uint32_t> index = corner(found);
      if (!index) return index.error();
      if (count < 2) {
        fan[count] = *index;
      } else {
        fan[2] = *index;
        if (corners_.size() == options_.triangle_limit)
          return fail(fmt::format("more than the limit of {} facets", options_.triangle_limit));
        corners_.push_back(fan);
        fan[1] = *index;
      }
      ++count;
    }
    if (count < 3) ++short_faces_;
    return {};
  }

  void remark_on(std::string_view kind) {
    for (const char* known : {"vt", "vn", "vp", "g", "o", "s", "l", "p", "usemtl", "mtllib", "usemap", "maplib", "mg", "bevel",
                              "c_interp", "d_interp", "lod", "shadow_obj", "trace_obj"})
      if (kind == known) return;
    if (remarks_++ == 0) remark_offset_ = offset_of(kind.data());
  }

  /// Facets at vertices without a position. errors  kInput: the first such vertex that a face uses, unless it may be dropped
  Status drop_bad_facets(Facets& facets) {
    Buffer<std::uint8_t> used(vertices_.size(), std::uint8_t{0}), bad(vertices_.size(), std::uint8_t{0});
    for (const auto& corners : corners_)
      for (const std::uint32_t corner : corners) used[corner] = 1;
    for (const BadVertex& vertex : bad_) {
      if (used[vertex.index] != 0 && !(vertex.how == Snapped::kNotFinite && options_.drop_bad))
        return fail(vertex.offset, what_is_wrong(vertex.how));
      bad[vertex.index] = 1;
    }
    std::size_t kept = 0;
    for (std::size_t i = 0; i < corners_.size(); ++i) {
      const auto [a, b, c] = corners_[i];
      if (!bad[a] && !bad[b] && !bad[c]) facets.triangles[kept++] = facets.triangles[i];
    }
    if (kept < corners_.size())
      facets.notes.push_back(
          {true, fmt::format("{} facets with coordinates that are not finite dropped", corners_.size() - kept)});
    facets.triangles.resize(kept);
    return {};
  }

  const Source& source_;
  const Snapper& snapper_;
  const LoadOptions& options_;
  const char *at_ = nullptr, *begin_ = nullptr, *end_ = nullptr;
  std::uint64_t offset_ = 0;
  Buffer<Point3> vertices_;
  Buffer<std::array<std::uint32_t, 3>> corners_;
  std::vector<BadVertex> bad_;    // rising
  std::vector<Forward> forward_;  // corners that came before their vertex
  std::uint64_t short_faces_ = 0, remarks_ = 0, remark_offset_ = 0, swallowed_ = 0, swallowed_offset_ = 0;
};

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

  /// Whether the line continues as a facet does after its first word.
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
    return rest_of_word();
  }
  std::string_view word() {
    while (at_ != end_ && is_space(*at_)) ++at_;
    return rest_of_word();
  }
  std::string_view rest_of_word() {
    const char* const begin = at_;
    while (at_ != end_ && !is_space(*at_)) ++at_;
    return {begin, static_cast<std::size_t>(at_ - begin)};
  }

  void fail(std::string_view at, std::string message) {
    block_.error_at = at.empty() ? end_ : at.data();
    block_.error = at.empty() ? "is cut short: the text ends within a facet; copy or export it again" : std::move(message);
  }

  bool misplaced(std::string_view found, std::string_view expected) {
    fail(found, fmt::format("{} where '{}' belongs", quoted(found), expected));
    return false;
  }

  bool expect(std::string_view lower_case) {
    const std::string_view found = word();
    return is_word(found, lower_case) || misplaced(found, lower_case);
  }

  bool outer_loop() {
    // "normal" and its numbers come first; what they are does not matter.
    for (int words = 0; words < 6; ++words) {
      const std::string_view found = word();
      if (is_word(found, "outer")) return expect("loop");
      if (found.empty() || is_word(found, "vertex") || is_word(found, "endfacet") || is_word(found, "facet"))
        return misplaced(found, "outer loop");
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
        fail(found, not_a_number(found));
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
      if (found.empty() || is_word(found, "vertex") || is_word(found, "facet") || is_word(found, "outer"))
        return misplaced(found, "endfacet");
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

Result<Facets> read_obj(const Source& source, const Snapper& snapper, const LoadOptions& options) {
  ObjParser parser(source, snapper, options);
  const Status read = for_each_window(
      source, kWindow, behind_last_line,
      [&](const char* begin, const char* end, std::uint64_t offset) { return parser.parse(begin, end, offset); });
  if (!read) return read.error();
  return parser.finish();
}

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
