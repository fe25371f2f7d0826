#include "stages/formats/threemf/mesh3mf.h"

#include <fmt/format.h>
#include <tbb/parallel_for.h>

#include <array>
#include <bit>
#include <vector>

#include "stages/formats/threemf/threemf_package.h"
#include "stages/support/text/decimal.h"

namespace lamina::formats {
namespace {

using Corners3mf = std::array<std::uint32_t, 3>;

/// Numbers points in the order in which they come: open addressing over indices, at most half full.
class PointIndex {
 public:
  explicit PointIndex(std::size_t expected) : slots_(std::bit_ceil(2 * expected + 16), kFree) {}

  std::uint32_t operator()(const Point3& point) {
    if (2 * points.size() >= slots_.size()) grow();
    for (std::size_t at = position(point);; at = (at + 1) & (slots_.size() - 1)) {
      if (slots_[at] == kFree) {
        slots_[at] = static_cast<std::uint32_t>(points.size());
        points.push_back(point);
        return slots_[at];
      }
      if (points[slots_[at]] == point) return slots_[at];
    }
  }

  Buffer<Point3> points;

 private:
  static constexpr std::uint32_t kFree = UINT32_MAX;

  std::size_t position(const Point3& p) const {
    std::uint64_t mixed = static_cast<std::uint32_t>(p.x) * 0x9e3779b97f4a7c15ull ^
                          static_cast<std::uint32_t>(p.y) * 0xc2b2ae3d27d4eb4full ^
                          static_cast<std::uint32_t>(p.z) * 0x165667b19e3779f9ull;
    mixed ^= mixed >> 32;
    mixed *= 0xd6e8feb86659fd93ull;
    return (mixed ^ mixed >> 32) & (slots_.size() - 1);
  }
  void grow() {
    slots_.assign(2 * slots_.size(), kFree);
    for (std::uint32_t i = 0; i < points.size(); ++i) {
      std::size_t at = position(points[i]);
      while (slots_[at] != kFree) at = (at + 1) & (slots_.size() - 1);
      slots_[at] = i;
    }
  }

  std::vector<std::uint32_t> slots_;
};

/// The text of a model, deflated in pieces by many threads.
struct Text3mf {
  std::vector<Deflated> pieces;
  Status status;

  void add(std::string_view text) {
    if (status) status = deflate_onto(pieces.emplace_back(), text);
  }

  /// Text of elements [0, count), each written by `put(index, text)`.
  template <class Put>
  void add_each(std::size_t count, const Put& put) {
    constexpr std::size_t kPiece = 16'384;
    const std::size_t first = pieces.size(), number = (count + kPiece - 1) / kPiece;
    pieces.resize(first + number);
    std::vector<Status> done(number);
    tbb::parallel_for(std::size_t{0}, number, [&](std::size_t piece) {
      Buffer<char> text;
      text.reserve(kPiece * 64);
      for (std::size_t i = piece * kPiece; i < std::min(count, (piece + 1) * kPiece); ++i) put(i, text);
      done[piece] = deflate_onto(pieces[first + piece], {text.data(), text.size()});
    });
    for (const Status& one : done)
      if (status) status = one;
  }
};

void put_vertex(const Point3& p, Buffer<char>& text) {
  append(text, "<vertex");
  append_attribute_mm(text, "x", p.x);
  append_attribute_mm(text, "y", p.y);
  append_attribute_mm(text, "z", p.z);
  append(text, "/>\n");
}

void put_triangle(const Corners3mf& corners, Buffer<char>& text) {
  append(text, "<triangle");
  append_attribute(text, "v1", corners[0]);
  append_attribute(text, "v2", corners[1]);
  append_attribute(text, "v3", corners[2]);
  append(text, "/>\n");
}

Status put_object(const Mesh3mfObject& object, std::size_t id, Text3mf& text, Mesh3mfCounts& counts) {
  PointIndex index(object.triangles.size() / 2);
  Buffer<Corners3mf> triangles;
  triangles.reserve(object.triangles.size());
  for (const Triangle& t : object.triangles) {
    if (t.a == t.b || t.b == t.c || t.c == t.a) continue;
    const std::uint32_t a = index(t.a), b = index(t.b), c = index(t.c);
    triangles.push_back({a, b, c});
  }
  counts.vertices += index.points.size();
  counts.triangles += triangles.size();
  counts.degenerate += object.triangles.size() - triangles.size();
  if (triangles.empty())
    return Error{Fault::kInput,
                 fmt::format("{}: has no triangle of three different corners, which 3MF cannot hold", object.name)};
  const std::string name = object.name.empty() ? "" : fmt::format(" name=\"{}\"", xml_text(object.name));
  text.add(fmt::format("<object id=\"{}\" type=\"model\"{}><mesh><vertices>\n", id, name));
  text.add_each(index.points.size(), [&](std::size_t i, Buffer<char>& out) { put_vertex(index.points[i], out); });
  text.add("</vertices><triangles>\n");
  text.add_each(triangles.size(), [&](std::size_t i, Buffer<char>& out) { put_triangle(triangles[i], out); });
  text.add("</triangles></mesh></object>\n");
  return text.status;
}

void put_item(const Instance& instance, Buffer<char>& text) {
  append(text, "<item");
  append_attribute(text, "objectid", std::uint64_t{instance.mesh} + 1);
  const Point3& offset = instance.offset;
  if (offset != Point3{0, 0, 0}) {
    append(text, " transform=\"1 0 0 0 1 0 0 0 1 ");
    append_mm(text, offset.x);
    append(text, " ");
    append_mm(text, offset.y);
    append(text, " ");
    append_mm(text, offset.z);
    append(text, "\"");
  }
  append(text, "/>\n");
}

}  // namespace

Result<Mesh3mfCounts> write_mesh_3mf(File& file, std::span<const Mesh3mfObject> objects, std::span<const Instance> instances,
                                     std::string_view program) {
  Mesh3mfCounts counts;
  Text3mf text;
  text.add(
      fmt::format("{}<model unit=\"millimeter\" xml:lang=\"en-US\" xmlns=\"{}\">\n<metadata "
                  "name=\"Application\">{}</metadata>\n<resources>\n",
                  kXmlDeclaration, kCore3mf, xml_text(program)));
  for (std::size_t i = 0; i < objects.size(); ++i) {
    if (Status status = put_object(objects[i], i + 1, text, counts); !status) return status.error();
  }
  text.add("</resources>\n<build>\n");
  text.add_each(instances.size(), [&](std::size_t i, Buffer<char>& out) { put_item(instances[i], out); });
  text.add("</build>\n</model>\n");
  if (!text.status) return text.status.error();
  if (Status status = write_3mf_package(file, text.pieces); !status) return status.error();
  return counts;
}

}  // namespace lamina::formats
