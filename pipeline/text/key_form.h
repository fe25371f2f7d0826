// pipeline/text/key_form.h: how the value of a key looks in TOML.
#pragma once

namespace lamina::pipeline {

enum class KeyForm { kBare, kString, kList };

}  // namespace lamina::pipeline
