#include "stages/load/threemf/xml.h"

#include <expat.h>
#include <fmt/core.h>

#include <algorithm>
#include <new>

namespace lamina::load {
namespace {

#if XML_MAJOR_VERSION > 2 || XML_MINOR_VERSION >= 9  // Debian 13
std::uint64_t line_of(XML_Parser parser) { return XML_GetCurrentLineNumber64(parser); }
std::int64_t byte_of(XML_Parser parser) { return XML_GetCurrentByteIndex64(parser); }
#else
std::uint64_t line_of(XML_Parser parser) { return XML_GetCurrentLineNumber(parser); }
std::int64_t byte_of(XML_Parser parser) { return XML_GetCurrentByteIndex(parser); }
#endif

constexpr std::uint32_t kDeepestXml = 256;
constexpr std::size_t kMaxNames = 4096, kMaxNamespaces = 64, kLongestName = 1024;
constexpr std::uint64_t kLongestTag = std::uint64_t{1} << 20;

}  // namespace

const char* find_attribute(XmlAttributes attributes, std::string_view name) {
  for (; *attributes != nullptr; attributes += 2)
    if (attributes[0] == name) return attributes[1];
  return nullptr;
}

struct XmlReader::Callbacks {
  static void start(void* user, const char* name, const char** attributes) {
    XmlReader& reader = *static_cast<XmlReader*>(user);
    if (!reader.fault_.empty()) return;
    if (++reader.depth_ > kDeepestXml)
      return reader.refuse(fmt::format("elements are nested more than {} deep; export it again", kDeepestXml));
    if (reader.last_ != name) reader.meet(reader.last_ = name);
    for (const char** attribute = attributes; *attribute != nullptr; attribute += 2) {
      const std::string_view own = *attribute;
      if (own.size() <= 2) continue;  // x, y, z, v1: too few to count
      reader.meet(own);
      if (own.starts_with("xmlns") && (own.size() == 5 || own[5] == ':'))
        reader.declare(own.substr(std::min<std::size_t>(own.size(), 6)), attribute[1]);
    }
    if (reader.fault_.empty()) reader.handler_.start(reader.find(name, true), attributes);
  }
  static void end(void* user, const char*) {
    XmlReader& reader = *static_cast<XmlReader*>(user);
    if (!reader.fault_.empty()) return;
    while (!reader.bindings_.empty() && reader.bindings_.back().depth == reader.depth_) reader.bindings_.pop_back();
    --reader.depth_;
    reader.handler_.end();
  }
  static void text(void* user, const char* text, int size) {
    XmlReader& reader = *static_cast<XmlReader*>(user);
    if (reader.fault_.empty()) reader.handler_.text({text, static_cast<std::size_t>(size)});
  }
  static void document_type(void* user, const char*, const char*, const char*, int) {
    static_cast<XmlReader*>(user)->refuse("has a document type, which 3MF forbids; export it again");
  }
};

XmlReader::XmlReader(XmlHandler& handler) : handler_(handler), parser_(XML_ParserCreate(nullptr)) {
  if (parser_ == nullptr) throw std::bad_alloc();
  XML_SetUserData(parser_, this);
  XML_SetElementHandler(parser_, Callbacks::start, Callbacks::end);
  XML_SetStartDoctypeDeclHandler(parser_, Callbacks::document_type);
}

XmlReader::~XmlReader() { XML_ParserFree(parser_); }

/// Counts different names, by their hashes.
void XmlReader::meet(std::string_view name) {
  if (name.size() > kLongestName) return refuse(fmt::format("has a name of more than {} bytes; export it again", kLongestName));
  if (names_.insert(std::hash<std::string_view>()(name)).second && names_.size() > kMaxNames)
    refuse(fmt::format("has more than {} different names of elements and attributes; export it again", kMaxNames));
}

void XmlReader::declare(std::string_view prefix, std::string_view space) {
  if (bindings_.size() >= kMaxNamespaces)
    return refuse(fmt::format("declares more than {} namespaces; export it again", kMaxNamespaces));
  bindings_.push_back({std::string(prefix), std::string(space), depth_});
}

XmlName XmlReader::find(std::string_view name, bool is_element) const {
  const std::size_t colon = name.find(':');
  const std::string_view prefix = colon == name.npos ? "" : name.substr(0, colon);
  const std::string_view local = colon == name.npos ? name : name.substr(colon + 1);
  if (prefix.empty() && !is_element) return {"", local};  // attributes have no default namespace
  if (prefix == "xml") return {"http://www.w3.org/XML/1998/namespace", local};
  if (prefix == "xmlns") return {"http://www.w3.org/2000/xmlns/", local};
  for (auto at = bindings_.rbegin(); at != bindings_.rend(); ++at) {
    if (at->prefix == prefix) return {at->space, local};
  }
  return {"", local, prefix.empty()};
}

XmlName XmlReader::attribute_name(std::string_view name) const { return find(name, false); }

std::uint64_t XmlReader::line() const { return line_of(parser_); }

void XmlReader::want_text(bool wanted) { XML_SetCharacterDataHandler(parser_, wanted ? Callbacks::text : nullptr); }

void XmlReader::refuse(std::string what, std::uint64_t line) {
  if (!fault_.empty()) return;
  fault_ = fmt::format("line {}: {}", line > 0 ? line : this->line(), what);
  XML_StopParser(parser_, XML_FALSE);
}

bool XmlReader::parse(std::string_view bytes, bool last) {
  if (!fault_.empty()) return false;
  if (XML_Parse(parser_, bytes.data(), static_cast<int>(bytes.size()), last ? 1 : 0) == XML_STATUS_OK) return true;
  const XML_Error code = XML_GetErrorCode(parser_);
  if (code == XML_ERROR_NO_MEMORY) throw std::bad_alloc();
  if (code == XML_ERROR_INCORRECT_ENCODING || code == XML_ERROR_UNKNOWN_ENCODING)
    refuse("is UTF-16 or UTF-32, or declares another encoding than it has; save it as UTF-8");
  else
    refuse(fmt::format("is not well-formed XML ({}); export it again", XML_ErrorString(code)));
  return false;
}

bool XmlReader::feed(std::string_view bytes) {
  fed_ += bytes.size();
  if (!parse(bytes, false)) return false;
  const std::int64_t at = byte_of(parser_);
  if (at >= 0 && fed_ - static_cast<std::uint64_t>(at) > kLongestTag + bytes.size())
    refuse(fmt::format("has a tag of more than {} bytes, or a comment; export it again", kLongestTag));
  return fault_.empty();
}

bool XmlReader::finish() { return parse({}, true) && fault_.empty(); }

}  // namespace lamina::load
