// stages/load/threemf/metadata.h: what a model, an object or a build item says about itself; internal to load.
#pragma once

#include <set>
#include <string>
#include <string_view>

#include "stages/load/threemf/model.h"
#include "stages/load/threemf/xml.h"

namespace lamina::load {

/// The metadata of one element. Names that are not as the specification wants them are told: many programs write such ones, and
/// readers should pass over them.
///
/// source  3MF Consortium, Core Specification 1.3, section 3.4.1
class Metadata {
 public:
  /// A <metadata> begins. errors  it has no name
  std::string begin(const XmlReader& reader, XmlAttributes attributes, ModelPackage& package);
  /// What older releases of Cura have instead.
  void begin_setting(XmlAttributes attributes);
  /// A piece of its text; what is long matters to nobody.
  void text(std::string_view piece);
  /// It ends; an object learns what Cura says of it.
  void end(ModelObject* object);

 private:
  std::set<std::string> names_;
  std::string name_, text_;
};

}  // namespace lamina::load
