// stages/load/unsupported/unsupported.cpp: signatures of formats, as their specifications have them.
#include "stages/load/unsupported/unsupported.h"

#include <algorithm>
#include <array>

namespace lamina::load {
namespace {

constexpr const char* kModeller = "; export the part from the CAD program as STL or 3MF";
constexpr const char* kMesh = "; convert it to STL, OBJ or 3MF, for example in Blender or MeshLab";
constexpr const char* kUnpack = "; unpack it and name the part in it";
constexpr const char* kWrongFile = "; name the part file itself";

struct Signature {
  std::string_view begin;
  const char* what;
  const char* remedy;
};

/// Bytes that no text and no header of a binary STL file begins with.
constexpr std::array<Signature, 18> kBytes{{
    {"\x89PNG", "is a PNG picture", kWrongFile},
    {"\xff\xd8\xff", "is a JPEG picture", kWrongFile},
    {"GIF8", "is a GIF picture", kWrongFile},
    {std::string_view("II*\0", 4), "is a TIFF picture", kWrongFile},
    {std::string_view("MM\0*", 4), "is a TIFF picture", kWrongFile},
    {"%PDF-", "is a PDF document", kModeller},
    {"\xd0\xcf\x11\xe0", "is a file of SolidWorks, Inventor or an old Office", kModeller},
    {"7z\xbc\xaf\x27\x1c", "is a 7z archive", kUnpack},
    {"Rar!\x1a\x07", "is a RAR archive", kUnpack},
    {"BZh", "is compressed by bzip2", kUnpack},
    {"\xfd"
     "7zXZ",
     "is compressed by xz", kUnpack},
    {"\x28\xb5\x2f\xfd", "is compressed by zstd", kUnpack},
    {"glTF", "is glTF, a scene", kMesh},
    {"Kaydara FBX Binary", "is FBX, a scene", kMesh},
    {"BLENDER", "is a Blender file", kMesh},
    {"3D Geometry File Format", "is a Rhino file", kModeller},
    {"\x7f"
     "ELF",
     "is a program", kWrongFile},
    {"SQLite format 3", "is a database", kWrongFile},
}};

/// Words that a text begins with, in capitals; behind them something else.
constexpr std::array<Signature, 16> kWords{{
    {"ISO-10303-21", "is STEP, a CAD file of exact surfaces", kModeller},
    {"PLY", "is PLY, a mesh", kMesh},
    {"OFF", "is OFF, a mesh", kMesh},
    {"COFF", "is OFF, a mesh", kMesh},
    {"NOFF", "is OFF, a mesh", kMesh},
    {"STOFF", "is OFF, a mesh", kMesh},
    {"#VRML", "is VRML, a scene", kMesh},
    {"#X3D", "is X3D, a scene", kMesh},
    {"#INVENTOR", "is Open Inventor, a scene", kMesh},
    {"**ABCDEFGHIJKLMNOPQRSTUVWXYZ", "is Parasolid, a CAD file of exact surfaces", kModeller},
    {"DBRep_DrawableShape", "is a BREP of Open Cascade, a CAD file of exact surfaces", kModeller},
    {"CASCADE", "is a BREP of Open Cascade, a CAD file of exact surfaces", kModeller},
    {"$$HEADERSTART", "is CLI, layers that are sliced already", kModeller},
    {"SOLIDWORKS", "is a SolidWorks file", kModeller},
    {"; FBX", "is FBX, a scene", kMesh},
    {"VERSION HTTPS://GIT-LFS", "is a pointer of git-lfs in place of the file; fetch it with git lfs pull", ""},
}};

/// Elements that an XML document has at its top, in lower case.
constexpr std::array<Signature, 9> kElements{{
    {"amf", "is AMF, a mesh", kMesh},
    {"x3d", "is X3D, a scene", kMesh},
    {"collada", "is COLLADA, a scene", kMesh},
    {"html", "is a web page, perhaps in place of a download that failed; download the part again", ""},
    {"!doctype html", "is a web page, perhaps in place of a download that failed; download the part again", ""},
    {"svg", "is an SVG drawing", kModeller},
    {"model", "is the model of a 3MF file without its zip; name the whole .3mf", ""},
    {"vtkfile", "is VTK, a mesh", kMesh},
    {"mesh", "is a mesh in XML", kMesh},
}};

char lower(char c) { return c >= 'A' && c <= 'Z' ? static_cast<char>(c - 'A' + 'a') : c; }

bool begins(std::string_view text, std::string_view with) {
  return text.size() >= with.size() &&
         std::equal(with.begin(), with.end(), text.begin(), [](char one, char other) { return lower(one) == lower(other); });
}

bool is_blank(char c) { return c == ' ' || (c >= '\t' && c <= '\r'); }

std::string said(const Signature& signature) { return std::string(signature.what) + signature.remedy; }

std::string xml_format(std::string_view head) {
  for (std::size_t at = head.find('<'); at != head.npos; at = head.find('<', at + 1)) {
    const std::string_view element = head.substr(at + 1);
    for (const Signature& known : kElements) {
      if (!begins(element, known.begin)) continue;
      const std::size_t behind = known.begin.size();
      if (behind >= element.size() || is_blank(element[behind]) || element[behind] == '>' || element[behind] == '/')
        return said(known);
    }
  }
  return "is XML of an unknown kind; export the part as STL, OBJ or 3MF";
}

/// IGES has lines of 80 characters; column 73 of the first is S, and a number follows.
bool is_iges(std::string_view head) {
  if (head.size() < 80 || head[72] != 'S' || head.substr(0, 80).find('\n') != head.npos) return false;
  const std::string_view number = head.substr(73, 7);
  return std::all_of(number.begin(), number.end(), [](char c) { return c == ' ' || (c >= '0' && c <= '9'); }) &&
         number.find('1') != number.npos;
}

/// A DXF drawing: group codes and values line by line.
bool is_dxf(std::string_view head) {
  const std::size_t section = head.substr(0, 64).find("SECTION");
  return section != head.npos && head.substr(0, section).find_first_not_of(" 0\r\n") == head.npos;
}

/// The end of a sentence that begins with the file's name: the format and what to do about it; "" if it is of no known one.
std::string unsupported_format(std::string_view head) {
  if (begins(head, "\xff\xfe") || begins(head, "\xfe\xff"))
    return "is text in UTF-16, two bytes a character; save it as UTF-8 or ASCII";
  for (const Signature& known : kBytes)
    if (head.substr(0, known.begin.size()) == known.begin) return said(known);
  if (head.size() > 262 && head.substr(257, 5) == "ustar") return std::string("is a tar archive") + kUnpack;
  if (is_iges(head)) return std::string("is IGES, a CAD file of exact surfaces") + kModeller;
  if (begins(head, "\xef\xbb\xbf")) head.remove_prefix(3);
  while (!head.empty() && is_blank(head.front())) head.remove_prefix(1);
  for (const Signature& known : kWords) {
    if (!begins(head, known.begin)) continue;
    const std::size_t behind = known.begin.size();
    // "off" and "ply" have to be whole words.
    if (behind > 5 || behind == head.size() || is_blank(head[behind]) || head[0] == '#') return said(known);
  }
  if (is_dxf(head)) return std::string("is DXF, a drawing") + kModeller;
  if (begins(head, "<")) return xml_format(head);
  if (begins(head, "{") || begins(head, "[")) {
    if (head.find("\"asset\"") != head.npos) return std::string("is glTF, a scene") + kMesh;
    return "is JSON, perhaps in place of a download that failed; download or export the part again";
  }
  return {};
}

}  // namespace

Status refuse_unsupported(const Source& source, std::string_view head) {
  const std::string format = unsupported_format(head);
  return format.empty() ? Status() : source.error(format);
}

bool is_machine_program(std::string_view head) {
  int commands = 0, others = 0;
  for (std::size_t at = 0; at < head.size();) {
    const std::size_t end = std::min(head.find_first_of("\r\n", at), head.size());
    std::string_view line = head.substr(at, end - at);
    at = end + 1;
    if (at > head.size()) break;  // the last line may be cut
    while (!line.empty() && is_blank(line.front())) line.remove_prefix(1);
    if (line.empty() || line.front() == ';' || line.front() == '%' || line.front() == '(') continue;
    const char first = lower(line.front());
    const bool is_command =
        (first == 'g' || first == 'm' || first == 't' || first == 'n') && line.size() > 1 && line[1] >= '0' && line[1] <= '9';
    ++(is_command ? commands : others);
  }
  return commands > 0 && commands >= 4 * others;
}

}  // namespace lamina::load
