# find_package(dynocar) gives dynocar::client, the shared library, and dynocar::client_static.
get_filename_component(_dynocar_usr "${CMAKE_CURRENT_LIST_DIR}/../../.." ABSOLUTE)
find_package(Threads REQUIRED)

if(NOT TARGET dynocar::client)
    add_library(dynocar::client SHARED IMPORTED)
    set_target_properties(dynocar::client PROPERTIES
        IMPORTED_LOCATION "${_dynocar_usr}/lib/@SONAME@"
        IMPORTED_SONAME "@SONAME@"
        INTERFACE_INCLUDE_DIRECTORIES "${_dynocar_usr}/include")
    add_library(dynocar::client_static STATIC IMPORTED)
    set_target_properties(dynocar::client_static PROPERTIES
        IMPORTED_LOCATION "${_dynocar_usr}/lib/libdynocar_client.a"
        INTERFACE_INCLUDE_DIRECTORIES "${_dynocar_usr}/include"
        INTERFACE_LINK_LIBRARIES "Threads::Threads;${CMAKE_DL_LIBS};m")
endif()
