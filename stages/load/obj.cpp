// stages/load/obj.cpp: Wavefront OBJ.
//
// Understood: v (colours or a weight behind the position are left out) and f with corners as v, v/t, v//n or v/t/n,
// counted from 1 or backwards from -1; polygons become fans from their first corner; lines end with LF, CRLF or CR and
// go on after a backslash. Groups, materials, normals, lines and points do not matter to a solid. Numbers are read in
// double precision: other readers of this format keep floats.
#include "stages/load/obj.h"

#include <fmt/core.h>
#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include <array>
#include <vector>

#include "stages/load/messages.h"
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
        while (at_ != end_ && !is_line_end(*at_)) ++at_;  // "# C:\\parts\\" does not go on in the next line
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
    if (!bad_.empty()) drop_bad_facets(facets);
    for (const Triangle& t : facets.triangles) facets.bounds.add(t.a), facets.bounds.add(t.b), facets.bounds.add(t.c);
    if (count == 0) return source_.error("holds no faces");
    if (short_faces_ > 0)
      facets.notes.push_back({false, fmt::format("{} faces with less than three corners are left out", short_faces_)});
    if (remarks_ > 0)
      facets.notes.push_back({false, fmt::format("{} lines are not understood and left out, the first is line {}", remarks_,
                                                 line_of(source_, remark_offset_))});
    return facets;
  }

 private:
  struct Forward {
    std::uint64_t index, offset;
  };

  /// The next word of the line; empty at its end.
  std::string_view word() {
    while (at_ != end_) {
      if (*at_ == '\\' && at_ + 1 != end_ && is_line_end(at_[1])) {
        at_ += at_[1] == '\r' && at_ + 2 != end_ && at_[2] == '\n' ? 3 : 2;
      } else if (is_space(*at_) && !is_line_end(*at_)) {
        ++at_;
      } else {
        break;
      }
    }
    const char* const begin = at_;
    while (at_ != end_ && !is_space(*at_) && !(*at_ == '\\' && at_ + 1 != end_ && is_line_end(at_[1]))) ++at_;
    return {begin, static_cast<std::size_t>(at_ - begin)};
  }

  void skip_line() {
    while (at_ != end_ && !is_line_end(*at_)) {
      const bool goes_on = *at_ == '\\' && at_ + 1 != end_ && is_line_end(at_[1]);
      at_ += goes_on ? (at_[1] == '\r' && at_ + 2 != end_ && at_[2] == '\n' ? 3 : 2) : 1;
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
      if (!parse_number(found, number)) return fail(fmt::format("{} is not a number", quoted(found)));
    }
    Point3 point{};
    const Snapped snapped = snapper_.snap(position[0], position[1], position[2], point);
    if (snapped == Snapped::kNotFinite && options_.drop_bad) {
      bad_.resize(vertices_.size(), 0);
      bad_.push_back(1);
    } else if (snapped != Snapped::kYes) {
      return fail(what_is_wrong(snapped));
    }
    if (vertices_.size() == UINT32_MAX) return fail("more than 4294967295 vertices");
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
    for (std::string_view found = word(); !found.empty() && found.front() != '#'; found = word()) {
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

  void drop_bad_facets(Facets& facets) {
    bad_.resize(vertices_.size(), 0);
    std::size_t kept = 0;
    for (std::size_t i = 0; i < corners_.size(); ++i) {
      const auto [a, b, c] = corners_[i];
      if (!bad_[a] && !bad_[b] && !bad_[c]) facets.triangles[kept++] = facets.triangles[i];
    }
    if (kept < corners_.size())
      facets.notes.push_back(
          {true, fmt::format("{} facets with coordinates that are not finite dropped", corners_.size() - kept)});
    facets.triangles.resize(kept);
  }

  const Source& source_;
  const Snapper& snapper_;
  const LoadOptions& options_;
  const char *at_ = nullptr, *begin_ = nullptr, *end_ = nullptr;
  std::uint64_t offset_ = 0;
  Buffer<Point3> vertices_;
  Buffer<std::array<std::uint32_t, 3>> corners_;
  std::vector<std::uint8_t> bad_;  // by vertex; empty if none is
  std::vector<Forward> forward_;   // corners that came before their vertex
  std::uint64_t short_faces_ = 0, remarks_ = 0, remark_offset_ = 0;
};

}  // namespace

Result<Facets> read_obj(const Source& source, const Snapper& snapper, const LoadOptions& options) {
  ObjParser parser(source, snapper, options);
  const Status read = for_each_window(
      source, kWindow, behind_last_line,
      [&](const char* begin, const char* end, std::uint64_t offset) { return parser.parse(begin, end, offset); });
  if (!read) return read.error();
  return parser.finish();
}

}  // namespace lamina::load
