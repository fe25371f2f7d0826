#include "stages/formats/threemf/threemf.h"

#include <fmt/format.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cstdlib>
#include <utility>

#include "stages/support/text/decimal.h"

namespace lamina::formats {
namespace {

constexpr std::string_view kXmlDeclaration = "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n";
constexpr std::string_view kCore3mf = "http://schemas.microsoft.com/3dmanufacturing/core/2015/02";
constexpr std::string_view kContentTypes =
    "<Types xmlns=\"http://schemas.openxmlformats.org/package/2006/content-types\">"
    "<Default Extension=\"rels\" ContentType=\"application/vnd.openxmlformats-package.relationships+xml\"/>"
    "<Default Extension=\"model\" ContentType=\"application/vnd.ms-package.3dmanufacturing-3dmodel+xml\"/></Types>\n";
constexpr std::string_view kRelationships =
    "<Relationships xmlns=\"http://schemas.openxmlformats.org/package/2006/relationships\">"
    "<Relationship Target=\"/3D/3dmodel.model\" Id=\"rel0\" "
    "Type=\"http://schemas.microsoft.com/3dmanufacturing/2013/01/3dmodel\"/></Relationships>\n";

/// The bytes of the character of UTF-8 at the front (RFC 3629), 0 if there is none that XML can hold.
std::size_t xml_character(std::string_view text) {
  const auto byte = [&](std::size_t i) -> std::uint32_t { return i < text.size() ? static_cast<unsigned char>(text[i]) : 0; };
  const std::uint32_t first = byte(0);
  if (first < 0x80) return first >= 0x20 && first != 0x7f ? 1 : 0;
  const std::size_t size = first >= 0xc2 && first < 0xe0   ? 2
                           : first >= 0xe0 && first < 0xf0 ? 3
                           : first >= 0xf0 && first < 0xf5 ? 4
                                                           : 0;
  if (size == 0) return 0;
  std::uint32_t code = first & (0x7fu >> size);
  for (std::size_t i = 1; i < size; ++i) {
    if ((byte(i) & 0xc0) != 0x80) return 0;
    code = code << 6 | (byte(i) & 0x3f);
  }
  constexpr std::uint32_t kSmallest[] = {0, 0, 0x80, 0x800, 0x10000};
  const bool surrogate = code >= 0xd800 && code < 0xe000, no_character = (code & 0xfffe) == 0xfffe || code > 0x10ffff;
  return code < kSmallest[size] || surrogate || no_character ? 0 : size;
}

Status add_text(ZipWriter& zip, std::string_view name, std::string_view text) {
  Deflated deflated;
  if (Status status = deflate_onto(deflated, std::string(kXmlDeclaration) + std::string(text)); !status) return status;
  return zip.add(name, {&deflated, 1});
}

/// Writes [Content_Types].xml, _rels/.rels and 3D/3dmodel.model, in this order, of the date that the environment's
/// SOURCE_DATE_EPOCH says, else of 1 January 1980.
///
/// model   the text of the model in pieces
/// errors  kOutput; kUsage: that variable is no number
/// source  ISO/IEC 29500-2 (Open Packaging Conventions); 3MF Consortium, Core Specification 1.3, section 2
Status write_3mf_package(File& file, std::span<const Deflated> model) {
  const Result<ZipDate> date = zip_date(std::getenv("SOURCE_DATE_EPOCH"));
  if (!date) return date.error();
  ZipWriter zip(file, *date);
  if (Status status = add_text(zip, "[Content_Types].xml", kContentTypes); !status) return status;
  if (Status status = add_text(zip, "_rels/.rels", kRelationships); !status) return status;
  if (Status status = zip.add("3D/3dmodel.model", model); !status) return status;
  return zip.finish();
}

/// Text for an attribute of XML: markup is escaped; bytes that are no UTF-8, and control characters, which XML cannot hold,
/// become question marks.
std::string xml_text(std::string_view text) {
  std::string out;
  while (!text.empty()) {
    const std::size_t size = xml_character(text);
    const std::string_view character = text.substr(0, size);
    if (size == 0)
      out += '?';
    else if (character == "&")
      out += "&amp;";
    else if (character == "<")
      out += "&lt;";
    else if (character == ">")
      out += "&gt;";
    else if (character == "\"")
      out += "&quot;";
    else
      out += character;
    text.remove_prefix(std::max<std::size_t>(size, 1));
  }
  return out;
}

/// Appends ` name="number"`.
void append_attribute(Buffer<char>& out, std::string_view name, std::uint64_t number) {
  append(out, " ");
  append(out, name);
  append(out, "=\"");
  append_written(out, kMaxDecimal, [&](char* to) { return put_whole(number, to); });
  append(out, "\"");
}

/// Appends ` name="mm"` with all digits of a nanometre.
void append_attribute_mm(Buffer<char>& out, std::string_view name, std::int64_t nm) {
  append(out, " ");
  append(out, name);
  append(out, "=\"");
  append_mm(out, nm);
  append(out, "\"");
}

void put_vertex(std::int64_t x, std::int64_t y, std::int64_t z, Buffer<char>& text) {
  append(text, "<vertex");
  append_attribute_mm(text, "x", x);
  append_attribute_mm(text, "y", y);
  append_attribute_mm(text, "z", z);
  append(text, "/>\n");
}

void put_triangle(std::uint32_t a, std::uint32_t b, std::uint32_t c, Buffer<char>& text) {
  append(text, "<triangle");
  append_attribute(text, "v1", a);
  append_attribute(text, "v2", b);
  append_attribute(text, "v3", c);
  append(text, "/>\n");
}

}  // namespace

Status check_3mf_date() {
  const Result<ZipDate> date = zip_date(std::getenv("SOURCE_DATE_EPOCH"));
  return date ? Status() : Status(date.error());
}

// Meshes.

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
  text.add_each(index.points.size(), [&](std::size_t i, Buffer<char>& out) {
    const Point3& p = index.points[i];
    put_vertex(p.x, p.y, p.z, out);
  });
  text.add("</vertices><triangles>\n");
  text.add_each(triangles.size(), [&](std::size_t i, Buffer<char>& out) {
    const auto& [a, b, c] = triangles[i];
    put_triangle(a, b, c, out);
  });
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

// Slices.

namespace {

constexpr std::size_t kEnoughText = std::size_t{64} << 10;

/// A polygon's segments lead from vertex to vertex, the last one back to the first.
void put_polygon(std::uint64_t first, std::uint64_t count, Buffer<char>& text) {
  append(text, "<s:polygon");
  append_attribute(text, "startv", first);
  append(text, ">");
  for (std::uint64_t i = 1; i <= count; ++i) {
    append(text, "<s:segment");
    append_attribute(text, "v2", first + i % count);
    append(text, "/>");
  }
  append(text, "</s:polygon>\n");
}

/// The box that stands for a body where slices say what it is (mesh resolution "lowres").
void put_box(const Box& box, std::int64_t left, std::int64_t front, Buffer<char>& text) {
  append(text, "<mesh><vertices>\n");
  for (std::uint32_t i = 0; i < 8; ++i) {
    put_vertex(((i & 1) != 0 ? box.hi.x : box.lo.x) - left, ((i & 2) != 0 ? box.hi.y : box.lo.y) - front,
               (i & 4) != 0 ? box.hi.z : box.lo.z, text);
  }
  append(text, "</vertices><triangles>\n");
  constexpr std::uint8_t kFaces[12][3] = {{0, 2, 3}, {0, 3, 1}, {4, 5, 7}, {4, 7, 6}, {0, 1, 5}, {0, 5, 4},
                                          {2, 6, 7}, {2, 7, 3}, {0, 4, 6}, {0, 6, 2}, {1, 3, 7}, {1, 7, 5}};
  for (const auto& [a, b, c] : kFaces) put_triangle(a, b, c, text);
  append(text, "</triangles></mesh>");
}

}  // namespace

Slice3mfWriter::Slice3mfWriter(const SliceHead& head)
    : bounds_(head.bounds),
      first_bottom_(head.first_bottom),
      left_(floor_div<std::int64_t>(head.bounds.lo.x, kNmPerMm) * kNmPerMm),
      front_(floor_div<std::int64_t>(head.bounds.lo.y, kNmPerMm) * kNmPerMm) {
  for (const std::string& name : head.parts) bodies_.push_back({name, {}, {}});
}

Result<Slice3mfWriter> Slice3mfWriter::make(const SliceHead& head) {
  if (Status status = check_3mf_date(); !status) return status.error();
  return Slice3mfWriter(head);
}

Status Slice3mfWriter::add(const SliceLayer& layer) {
  for (std::size_t b = 0; b < bodies_.size(); ++b) {
    Buffer<char>& text = bodies_[b].waiting;
    append(text, "<s:slice");
    append_attribute_mm(text, "ztop", std::int64_t{layer.layer.bottom} + layer.layer.thickness);
    const std::uint32_t begin = layer.body[b], end = layer.body[b + 1];
    append(text, begin == end ? "/>\n" : "><s:vertices>\n");
    for (std::uint32_t c = begin; c < end; ++c) {
      for (const Point2 p : layer.contours[c]) {
        append(text, "<s:vertex");
        append_attribute_mm(text, "x", p.x - left_);
        append_attribute_mm(text, "y", p.y - front_);
        append(text, "/>\n");
      }
    }
    if (begin < end) append(text, "</s:vertices>\n");
    std::uint64_t first = 0;
    for (std::uint32_t c = begin; c < end; ++c) {
      const std::uint64_t count = layer.contours[c].size();
      put_polygon(first, count, text);
      first += count;
    }
    if (begin < end) append(text, "</s:slice>\n");
    if (text.size() < kEnoughText) continue;
    if (Status status = deflate_onto(bodies_[b].slices, {text.data(), text.size()}); !status) return status;
    text.clear();
  }
  return {};
}

std::string Slice3mfWriter::objects_and_build() const {
  Buffer<char> text;
  for (std::size_t b = 0; b < bodies_.size(); ++b) {
    append(text, "<object");
    append_attribute(text, "id", bodies_.size() + b + 1);
    append(text, fmt::format(" type=\"model\" name=\"{}\"", xml_text(bodies_[b].name)));
    append_attribute(text, "s:slicestackid", b + 1);
    append(text, " s:meshresolution=\"lowres\">");
    put_box(bounds_, left_, front_, text);
    append(text, "</object>\n");
  }
  append(text, "</resources>\n<build>\n");
  for (std::size_t b = 0; b < bodies_.size(); ++b) {
    append(text, "<item");
    append_attribute(text, "objectid", bodies_.size() + b + 1);
    append(text, " transform=\"1 0 0 0 1 0 0 0 1 ");
    append_mm(text, left_);
    append(text, " ");
    append_mm(text, front_);
    append(text, " 0\"/>\n");
  }
  append(text, "</build>\n</model>\n");
  return {text.begin(), text.end()};
}

Result<File> Slice3mfWriter::write(const std::string& path, const FileOptions& options) {
  std::vector<Deflated> pieces(1);
  const auto put = [&](std::string_view text) { return deflate_onto(pieces.back(), text); };
  Status status =
      put(fmt::format("{}<model unit=\"millimeter\" xml:lang=\"en-US\" xmlns=\"{}\" xmlns:s=\"{}\" "
                      "requiredextensions=\"s\">\n<resources>\n",
                      kXmlDeclaration, kCore3mf, "http://schemas.microsoft.com/3dmanufacturing/slice/2015/07"));
  for (std::size_t b = 0; status && b < bodies_.size(); ++b) {
    PartBody& body = bodies_[b];
    Buffer<char> head;
    append(head, "<s:slicestack");
    append_attribute(head, "id", b + 1);
    append_attribute_mm(head, "zbottom", first_bottom_);
    append(head, ">\n");
    status = put({head.data(), head.size()});
    if (status) status = deflate_onto(body.slices, {body.waiting.data(), body.waiting.size()});
    pieces.push_back(std::move(body.slices));
    pieces.emplace_back();
    if (status) status = put("</s:slicestack>\n");
  }
  if (status) status = put(objects_and_build());
  if (!status) return Error{Fault::kOutput, path + ": " + status.error().message};
  auto file = File::open(path, options);
  if (!file) return file.error();
  status = write_3mf_package(*file, pieces);
  if (status) status = file->flush();
  if (!status) return status.error();
  return file;
}

}  // namespace lamina::formats
