#include "stages/formats/threemf/slice3mf.h"

#include <fmt/format.h>

#include <utility>

#include "stages/formats/threemf/threemf_package.h"
#include "stages/support/io/file.h"
#include "stages/support/text/decimal.h"

namespace lamina::formats {
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
    append(text, "<vertex");
    append_attribute_mm(text, "x", ((i & 1) != 0 ? box.hi.x : box.lo.x) - left);
    append_attribute_mm(text, "y", ((i & 2) != 0 ? box.hi.y : box.lo.y) - front);
    append_attribute_mm(text, "z", (i & 4) != 0 ? box.hi.z : box.lo.z);
    append(text, "/>\n");
  }
  append(text, "</vertices><triangles>\n");
  constexpr std::uint8_t kFaces[12][3] = {{0, 2, 3}, {0, 3, 1}, {4, 5, 7}, {4, 7, 6}, {0, 1, 5}, {0, 5, 4},
                                          {2, 6, 7}, {2, 7, 3}, {0, 4, 6}, {0, 6, 2}, {1, 3, 7}, {1, 7, 5}};
  for (const auto& face : kFaces) {
    append(text, "<triangle");
    append_attribute(text, "v1", face[0]);
    append_attribute(text, "v2", face[1]);
    append_attribute(text, "v3", face[2]);
    append(text, "/>\n");
  }
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
