# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

# Leaves the C++ type support for introspection out, which neither Python nor Fast DDS loads. Packages of ROS
# link to its target by name, which has to exist.
set(CMAKE_DISABLE_FIND_PACKAGE_rosidl_typesupport_introspection_cpp TRUE)
add_library(rosidl_typesupport_introspection_cpp::rosidl_typesupport_introspection_cpp INTERFACE IMPORTED GLOBAL)
