// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <string_view>

#include "evpose/io/bags/message_reader.h"

namespace evpose {

/// The definition of a message type that we write, with those of the types in it, as bags carry it: of
/// "package/Type", in the language of ROS 1 or, for CDR, of ROS 2.
std::string message_definition(std::string_view type, Wire wire);

/// The MD5 by which ROS 1 tells definitions apart.
std::string_view message_md5(std::string_view type);

}  // namespace evpose
