// stages/load/messages.h: the words of a file as errors and notes quote them; internal to load.
#pragma once

#include <string>
#include <string_view>

namespace lamina::load {

struct ModelObject;
struct ModelPackage;

/// A word of the file: short, and without bytes that a terminal would act on.
std::string quoted(std::string_view word);

/// An extension of 3MF by its namespace: "beam lattice (http://...)", or the namespace alone where it has no known name.
std::string extension_label(std::string_view space);

/// An object of a package: "object 3 "cap"", or with its file where that is not the first one.
std::string label(const ModelPackage& package, const ModelObject& object);

}  // namespace lamina::load
