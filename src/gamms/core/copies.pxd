cimport cython

cdef extern from "Python.h":
    cpdef dict as_dict "Py_NewRef" (object value)

cpdef copy_deep(object value, object memo=*)
cpdef copy_values(object each, object memo=*)
cpdef copy_items(object values, object memo=*, str owner=*)
cpdef copy_dict(object value, object memo=*)
@cython.locals(made=dict)
cpdef copy_each(object dicts, object memo=*)
@cython.locals(made=dict)
cpdef copy_filled(object each, object memo=*)
@cython.locals(one=tuple)
cpdef list copy_fields(list values, list copies, object memo=*)
@cython.locals(one=tuple)
cpdef int restore_fields(object state, list values, list shared, list replaced, list refilled) except -1
cpdef refill(object known, object value)
cpdef refill_each(object known, object value)
cpdef refill_counts(object known, object value)
cdef _add_missing(object known, object value)
cdef _copy_or_share(object value, object memo)
@cython.locals(known=dict, made=dict, own=object)
cdef object _copy_plain(object value, set seen)
