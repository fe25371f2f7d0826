// tests/load/archives.h: gzip and zip files made byte by byte, so that they can be wrong on purpose.
#pragma once

#include <zlib.h>

#include <cstdint>
#include <string>
#include <utility>
#include <vector>

namespace lamina::test {

inline std::string deflated(const std::string& bytes, int window_bits) {
  z_stream stream{};
  deflateInit2(&stream, 9, Z_DEFLATED, window_bits, 9, Z_DEFAULT_STRATEGY);
  std::string out(deflateBound(&stream, static_cast<uLong>(bytes.size())) + 64, '\0');
  stream.next_in = reinterpret_cast<Bytef*>(const_cast<char*>(bytes.data()));
  stream.avail_in = static_cast<uInt>(bytes.size());
  stream.next_out = reinterpret_cast<Bytef*>(out.data());
  stream.avail_out = static_cast<uInt>(out.size());
  deflate(&stream, Z_FINISH);
  out.resize(stream.total_out);
  deflateEnd(&stream);
  return out;
}

inline std::string gzip(const std::string& bytes) { return deflated(bytes, 16 + MAX_WBITS); }

inline std::string little(std::uint32_t number, int bytes) {
  std::string text;
  for (int i = 0; i < bytes; ++i) text += static_cast<char>(number >> (8 * i) & 0xff);
  return text;
}

/// A zip file (APPNOTE 6.3, sections 4.3.7 to 4.3.16) of deflated entries. `flags` is the general purpose bit flag.
inline std::string zip(const std::vector<std::pair<std::string, std::string>>& entries, std::uint32_t flags = 0) {
  std::string file, directory;
  for (const auto& [name, bytes] : entries) {
    const std::string packed = deflated(bytes, -MAX_WBITS);
    const auto crc =
        static_cast<std::uint32_t>(crc32(0, reinterpret_cast<const Bytef*>(bytes.data()), static_cast<uInt>(bytes.size())));
    const std::string common = little(20, 2) + little(flags, 2) + little(8, 2) + little(0, 4) + little(crc, 4) +
                               little(static_cast<std::uint32_t>(packed.size()), 4) +
                               little(static_cast<std::uint32_t>(bytes.size()), 4) +
                               little(static_cast<std::uint32_t>(name.size()), 2) + little(0, 2);
    directory += "PK\x01\x02" + little(20, 2) + common + little(0, 2) + little(0, 2) + little(0, 2) + little(0, 4) +
                 little(static_cast<std::uint32_t>(file.size()), 4) + name;
    file += "PK\x03\x04" + common + name + packed;
  }
  const auto count = static_cast<std::uint32_t>(entries.size());
  return file + directory + "PK\x05\x06" + little(0, 4) + little(count, 2) + little(count, 2) +
         little(static_cast<std::uint32_t>(directory.size()), 4) + little(static_cast<std::uint32_t>(file.size()), 4) +
         little(0, 2);
}

/// The parts of a 3MF package around a model.
inline std::vector<std::pair<std::string, std::string>> package(const std::string& model) {
  return {{"[Content_Types].xml",
           "<?xml version=\"1.0\" encoding=\"UTF-8\"?><Types xmlns=\"http://schemas.openxmlformats.org/package/2006/"
           "content-types\"><Default Extension=\"rels\" ContentType=\"application/vnd.openxmlformats-package."
           "relationships+xml\"/><Default Extension=\"model\" ContentType=\"application/vnd.ms-package."
           "3dmanufacturing-3dmodel+xml\"/></Types>"},
          {"_rels/.rels",
           "<?xml version=\"1.0\" encoding=\"UTF-8\"?><Relationships xmlns=\"http://schemas.openxmlformats.org/package/"
           "2006/relationships\"><Relationship Target=\"/3D/3dmodel.model\" Id=\"rel0\" Type=\"http://schemas."
           "microsoft.com/3dmanufacturing/2013/01/3dmodel\"/></Relationships>"},
          {"3D/3dmodel.model", model}};
}

inline std::string model(const std::string& resources, const std::string& build, const std::string& unit = "millimeter") {
  return "<?xml version=\"1.0\" encoding=\"UTF-8\"?><model unit=\"" + unit +
         "\" xml:lang=\"en-US\" xmlns=\"http://schemas.microsoft.com/3dmanufacturing/core/2015/02\"><resources>" + resources +
         "</resources><build>" + build + "</build></model>";
}

/// An object whose mesh is a box from the origin.
inline std::string box_object(int id, int x, int y, int z, const std::string& attributes = "type=\"model\"") {
  std::string text = "<object id=\"" + std::to_string(id) + "\" " + attributes + "><mesh><vertices>";
  for (int i = 0; i < 8; ++i)
    text += "<vertex x=\"" + std::to_string(i & 1 ? x : 0) + "\" y=\"" + std::to_string(i & 2 ? y : 0) + "\" z=\"" +
            std::to_string(i & 4 ? z : 0) + "\"/>";
  text += "</vertices><triangles>";
  for (const char* t : {"023", "031", "457", "476", "015", "054", "267", "273", "046", "062", "137", "175"})
    text += std::string("<triangle v1=\"") + t[0] + "\" v2=\"" + t[1] + "\" v3=\"" + t[2] + "\"/>";
  return text + "</triangles></mesh></object>";
}

inline std::string item(int id, const std::string& transform = "") {
  return "<item objectid=\"" + std::to_string(id) + "\"" + (transform.empty() ? "" : " transform=\"" + transform + "\"") + "/>";
}

inline std::string component(int id, const std::string& transform = "") {
  return "<component objectid=\"" + std::to_string(id) + "\"" + (transform.empty() ? "" : " transform=\"" + transform + "\"") +
         "/>";
}

inline std::string components(int id, const std::string& inner) {
  return "<object id=\"" + std::to_string(id) + "\" type=\"model\"><components>" + inner + "</components></object>";
}

}  // namespace lamina::test
