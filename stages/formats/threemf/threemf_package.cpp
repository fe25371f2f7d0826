#include "stages/formats/threemf/threemf_package.h"

#include <cstdlib>

#include "stages/formats/zip/zip.h"
#include "stages/support/text/decimal.h"

namespace lamina::formats {
namespace {

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

}  // namespace

Status check_3mf_date() {
  const Result<ZipDate> date = zip_date(std::getenv("SOURCE_DATE_EPOCH"));
  return date ? Status() : Status(date.error());
}

Status write_3mf_package(File& file, std::span<const Deflated> model) {
  const Result<ZipDate> date = zip_date(std::getenv("SOURCE_DATE_EPOCH"));
  if (!date) return date.error();
  ZipWriter zip(file, *date);
  if (Status status = add_text(zip, "[Content_Types].xml", kContentTypes); !status) return status;
  if (Status status = add_text(zip, "_rels/.rels", kRelationships); !status) return status;
  if (Status status = zip.add("3D/3dmodel.model", model); !status) return status;
  return zip.finish();
}

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

void append_attribute(Buffer<char>& out, std::string_view name, std::uint64_t number) {
  append(out, " ");
  append(out, name);
  append(out, "=\"");
  append_written(out, kMaxDecimal, [&](char* to) { return put_whole(number, to); });
  append(out, "\"");
}

void append_attribute_mm(Buffer<char>& out, std::string_view name, std::int64_t nm) {
  append(out, " ");
  append(out, name);
  append(out, "=\"");
  append_mm(out, nm);
  append(out, "\"");
}

}  // namespace lamina::formats
