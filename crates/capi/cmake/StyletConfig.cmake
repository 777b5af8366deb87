# find_package(Stylet) gives Stylet::stylet (shared) and Stylet::stylet_static. Lies in <prefix>/lib/cmake/Stylet.
get_filename_component(_stylet_prefix "${CMAKE_CURRENT_LIST_DIR}/../../.." ABSOLUTE)
if(NOT TARGET Stylet::stylet)
    add_library(Stylet::stylet SHARED IMPORTED)
    set_target_properties(Stylet::stylet PROPERTIES
        IMPORTED_NO_SONAME TRUE
        IMPORTED_LOCATION "${_stylet_prefix}/lib/libstylet${CMAKE_SHARED_LIBRARY_SUFFIX}"
        INTERFACE_INCLUDE_DIRECTORIES "${_stylet_prefix}/include")
    add_library(Stylet::stylet_static STATIC IMPORTED)
    set_target_properties(Stylet::stylet_static PROPERTIES
        IMPORTED_LOCATION "${_stylet_prefix}/lib/libstylet${CMAKE_STATIC_LIBRARY_SUFFIX}"
        INTERFACE_INCLUDE_DIRECTORIES "${_stylet_prefix}/include"
        INTERFACE_LINK_LIBRARIES "m;pthread;dl")
endif()
set(Stylet_FOUND TRUE)
