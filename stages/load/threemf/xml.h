// stages/load/threemf/xml.h: XML read by expat with bounds on what it may hold; internal to load.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <unordered_set>
#include <vector>

#include "stages/data/status.h"

struct XML_ParserStruct;

namespace lamina::load {

/// The attributes of an element as they stand there: name, value, name, value, null.
using XmlAttributes = const char* const*;

struct XmlName {
  std::string_view space;  // namespace; "" for none
  std::string_view local;
  bool declared = true;  // whether its prefix, if it has one, leads to a namespace
};

/// The value of an attribute; null where the element does not have it.
const char* find_attribute(XmlAttributes attributes, std::string_view name);

class XmlHandler {
 public:
  virtual ~XmlHandler() = default;
  /// An element begins.
  virtual void start(const XmlName& name, XmlAttributes attributes) = 0;
  virtual void end() = 0;
  /// A piece of the text of an element, which may come in several. Only where XmlReader::want_text() requests it.
  virtual void text(std::string_view) {}
};

/// Text that begins with a byte order mark or a declaration may be UTF-8, UTF-16 or Latin-1. Document types, and with them
/// entities, are refused as 3MF demands. So are elements nested more than 256 deep, tags of more than 1 MiB, more than 64
/// namespaces at once, and more than 4096 different names: expat keeps each. Prefixes are resolved here, and not by expat,
/// since files are read, too, that use an undeclared one where it does not matter.
///
/// cost  0.3 us a tag; 2 MiB and the names
class XmlReader {
 public:
  /// handler  has to outlive the reader
  explicit XmlReader(XmlHandler& handler);
  XmlReader(const XmlReader&) = delete;
  ~XmlReader();

  /// false once something is wrong
  bool feed(std::string_view bytes);
  bool finish();
  /// Called by the handler: `what` is wrong here, and nothing more is read. The first reason counts.
  /// line  where, if not here
  void refuse(std::string what, std::uint64_t line = 0);
  /// Whether the handler gets text from here on. Not at first: most is white space.
  void want_text(bool wanted);

  /// The name of an attribute, or the namespace of a prefix as "prefix:", as the handler's element has it.
  XmlName attribute_name(std::string_view name) const;
  /// Where the handler's element begins.
  std::uint64_t line() const;
  /// "line 12: ..."; empty if nothing is wrong
  std::string_view fault() const { return fault_; }

 private:
  struct Callbacks;
  bool parse(std::string_view bytes, bool last);
  void meet(std::string_view name);
  void declare(std::string_view prefix, std::string_view space);
  XmlName find(std::string_view name, bool is_element) const;

  struct Binding {
    std::string prefix, space;
    std::uint32_t depth;  // of the element that declares it
  };

  XmlHandler& handler_;
  XML_ParserStruct* parser_;
  std::uint64_t fed_ = 0;
  std::uint32_t depth_ = 0;
  std::vector<Binding> bindings_;
  std::unordered_set<std::size_t> names_;  // hashes
  std::string last_;                       // element, which most often comes again
  std::string fault_;
};

}  // namespace lamina::load
