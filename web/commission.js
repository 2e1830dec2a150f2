// A drive in the page is not commissioned: its machine is known.

export const guide = "";
export const commissioning = () => {};
export const fetchCourse = async () => {};
export const tick = () => {};
